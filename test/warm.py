# SPDX-License-Identifier: BSD-3-Clause
"""A command `grid-map` that is quick to start: a fork of a process that has imported libraries.

`python3 -P test/warm.py FOLDER` puts the command into a folder, prints a line, and serves the
command. It differs from the installed one in that its environment is that of the server, and in
that signals do not reach it.
"""

import atexit
import gc
import os
import socket
import sys
import traceback
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from runpy import run_module
from typing import NoReturn

# Without rclpy, which starts threads: a fork would lack them.
LIBRARIES = (
    *("cv2", "dask.array", "distributed", "matplotlib.pyplot", "rasterio", "scipy.interpolate"),
    *("scipy.ndimage", "scipy.spatial", "trimesh", "xarray", "zarr"),
    *("grid_map_core_py.tiled", "grid_map_filters_py", "grid_map_ros_py.bags"),
    "grid_map_visualization_py.pictures",
)

CLIENT = f"""#!{sys.executable} -ISB
import os, socket, sys
with socket.socket(socket.AF_UNIX) as server:
    server.connect(os.path.join(os.path.dirname(__file__), "socket"))
    words = "\\0".join([os.getcwd(), *sys.argv[1:]])
    socket.send_fds(server, [words.encode()], [0, 1, 2])
    sys.exit(int(server.recv(9)))
"""


def serve(folder: Path) -> NoReturn:
    """Serve the command until the process is killed."""
    for name in LIBRARIES:
        import_module(name)
    server = socket.socket(socket.AF_UNIX)
    server.bind(str(folder / "socket"))
    server.listen()
    (folder / "grid-map").write_text(CLIENT)
    (folder / "grid-map").chmod(0o755)
    print("serves", flush=True)
    gc.freeze()
    while True:
        connection, _ = server.accept()
        if not os.fork():
            server.close()
            answer(connection)
        connection.close()
        with suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass


def answer(connection: socket.socket) -> NoReturn:
    """Run a command, answer with its exit code and end the process."""
    words, files, *_ = socket.recv_fds(connection, 2**16, 3)
    if process := os.fork():
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        connection.sendall(str(code if code >= 0 else 128 - code).encode())
        os._exit(0)
    connection.close()
    for number, file in enumerate(files):
        os.dup2(file, number)
        os.close(file)
    folder, *sys.argv[1:] = words.decode().split("\0")
    os.chdir(folder)
    try:
        run_module("grid_map_core_py", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
        code = 1
    # An ordinary end would delete all modules, and so copy the memory of the server.
    atexit._run_exitfuncs()
    os._exit(code)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
