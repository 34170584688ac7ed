# SPDX-License-Identifier: BSD-3-Clause
"""Demos of several nodes without launch files: each node is a process, and ends with the demo."""

import argparse
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import takewhile
from pathlib import Path
from types import FrameType

from grid_map_core_py._commands import die_with_parent, on_end

VIEWERS = {
    "rerun_cli": "grid_map_visualization_py._executables.rerun_viewer",
    "viser": "grid_map_visualization_py._executables.web_viewer",
}
"""Viewers by the module that they need, the better one first."""

PATIENCE = 5.0
"""Maximum time for a process to stop before it is killed [s]."""


@dataclass(frozen=True)
class NodesDemo:
    """A demo that starts nodes, and a report or the viewer of the browser if they are wanted.

    Attributes:
        name: name of the executable.
        about: one sentence for its help.
        report: module of the node that writes a report and ends the demo.
        report_file: file of its parameters in `config`.
        viewer_file: file of the parameters of the viewers.
    """

    name: str
    about: str
    report: str
    report_file: str
    viewer_file: str

    def run(
        self,
        nodes: Mapping[str, str],
        arguments: Sequence[str] | None,
        *,
        steps: Iterable[object] = (),
        parameters: Mapping[str, str] | None = None,
    ) -> int:
        """Run the demo; return its exit code.

        Args:
            nodes: parameter files in `config` by module.
            arguments: the command line, None for that of the process.
            steps: what is done before the nodes start, step by step; an interrupt ends it.
            parameters: another parameter of a node, as `name:=value`, by module.
        """
        with ProcessGroup() as processes:
            options = self._parse(arguments)
            for _ in takewhile(lambda _: not processes.stopped, steps):
                pass
            for module, file in nodes.items():
                given = (parameters or {}).get(module)
                processes.start(module, file, *([given] if given else []))
            if options.view is not None:
                processes.start(viewer(), self.viewer_file, f"port:={options.view}")
            if options.report:
                folder = f"output_directory:={options.report}"
                processes.start(self.report, self.report_file, folder)
            ended = processes.wait()
        if ended is None:
            return 1 if options.report else 0
        module, code = ended
        if module == self.report:
            return code
        print(f"{self.name}: {module} ended with exit code {code}", file=sys.stderr)
        return code or 1

    def _parse(self, arguments: Sequence[str] | None) -> argparse.Namespace:
        parser = argparse.ArgumentParser(prog=self.name, description=self.about)
        about = "write pictures there, print a table and end"
        parser.add_argument("--report", metavar="DIRECTORY", help=about)
        about = "show the demo in the browser, at http://127.0.0.1:8080 or another port"
        parser.add_argument("--view", metavar="PORT", nargs="?", type=int, const=8080, help=about)
        words = sys.argv[1:] if arguments is None else arguments
        # `ros2 launch` and `ros2 run` may append arguments that are meant for ROS.
        return parser.parse_args(list(takewhile(lambda word: word != "--ros-args", words)))


def viewer() -> str:
    """Return the module of the first viewer whose library is installed, or of the last one."""
    return next((VIEWERS[name] for name in VIEWERS if find_spec(name)), [*VIEWERS.values()][-1])


class ProcessGroup:
    """Starts Python modules as processes and stops them all on exit.

    An interrupt (Ctrl-C) or a request to terminate only sets `stopped`: nothing is torn down
    halfway, and no traceback is printed. The processes do not see the Ctrl-C of the terminal
    themselves.
    """

    def __init__(self) -> None:
        self.stopped = False
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> "ProcessGroup":
        on_end(self._stop)
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            # Unlike SIGINT, this prints nothing while Python is still starting.
            process.terminate()
        deadline = time.monotonic() + PATIENCE
        for process in self._processes.values():
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        # Python removes its own handlers as it ends.
        on_end(signal.SIG_IGN)

    def start(self, module: str, parameter_file: str, *parameters: str) -> None:
        """Start a node, unless the group has been stopped.

        Args:
            module: the module of the node.
            parameter_file: its name in the folder `config`.
            parameters: other parameters, each as `name:=value`.
        """
        from ament_index_python.packages import get_package_share_directory

        if not self.stopped:
            folder = Path(get_package_share_directory("grid_map_demos_py"), "config")
            file = str(folder / parameter_file)
            given = [word for parameter in parameters for word in ("-p", parameter)]
            command = [sys.executable, "-m", module, "--ros-args", "--params-file", file, *given]
            self._processes[module] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                preexec_fn=die_with_parent(signal.SIGTERM),
            )

    def wait(self) -> tuple[str, int] | None:
        """Wait until a process ends, and return its module and exit code; None when stopped."""
        while not self.stopped:
            for module, process in self._processes.items():
                code = process.poll()
                if code is not None:
                    return module, code
            time.sleep(0.05)
        return None

    def _stop(self, _number: int, _frame: FrameType | None) -> None:
        self.stopped = True
