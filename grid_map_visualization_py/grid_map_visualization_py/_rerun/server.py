# SPDX-License-Identifier: BSD-3-Clause
"""Serves a recording of Rerun to browsers."""

import os
import random
import socket
import subprocess
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from grid_map_core_py._commands import die_with_parent
from grid_map_core_py.errors import GridMapError

from .._viewer.page import is_loopback, url_of
from .front import Address, Front
from .scene import rerun

SETTINGS = Path(__file__).with_name("settings")
"""Folder of the settings of Rerun: its statistics of use are off, and nothing is written."""

PATIENCE = 30.0
"""Maximum time for the program to start [s]."""

FAREWELL = 0.3
"""Maximum time for the last data to reach the program [s]."""


class ServerError(GridMapError):
    """The page cannot be served."""


class Server:
    """Serves a recording to browsers and to Rerun's own viewer.

    The program `rerun` keeps the recording in a process of its own, which ends with this process.
    It listens at a random address of this machine, where no page of a browser can guess it; `Front`
    passes requests on to it. The thread that makes the server must not end before the server.

    Args:
        host: host name or IP address at which the page is served.
        port: port of the page; 0 for any free one.
        memory_limit: size of the kept messages, such as `512MB` or `20%` of the memory. Older ones
            are dropped.
        allowed_hosts: names under which browsers may open the page, besides IP addresses,
            `localhost`, `host` and the name of this machine, with or without `.local`.
        name: name of the recording.

    Attributes:
        recording: the recording, a `rerun.RecordingStream`. Calls of it may wait for the program.
        page_url: address of the page; Rerun's options such as `?renderer=webgl` may follow.
        is_public: other machines can reach the page.

    Raises:
        MissingPackageError: Rerun is not installed.
        ServerError: the page cannot be served at this address, or the program does not start.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 9876,
        *,
        memory_limit: str = "512MB",
        allowed_hosts: Sequence[str] = (),
        name: str = "grid_map",
    ) -> None:
        sdk, program = rerun(), rerun("rerun_cli")
        listener = _listen(host, port)
        machine = socket.gethostname()
        names = {host, "localhost", machine, f"{machine}.local", *allowed_hosts}
        self.page_url = url_of(host, listener.getsockname()[1])
        self.is_public = not is_loopback(host)
        hidden = f"127.{random.randint(1, 254)}.{random.randint(1, 254)}.{random.randint(1, 254)}"
        data, page = ((hidden, number) for number in random.sample(range(10_000, 30_000), 2))
        command = [
            *(str(Path(program.__file__).with_name("rerun")), "--serve-web", "--bind", hidden),
            *("--port", str(data[1]), "--web-viewer-port", str(page[1])),
            *("--server-memory-limit", memory_limit),
        ]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            env={**os.environ, "XDG_CONFIG_HOME": str(SETTINGS), "RUST_LOG": "warn"},
            # Ctrl-C is for this process, which ends the program.
            start_new_session=True,
            preexec_fn=die_with_parent(),
        )
        self._front: Front | None = None
        self.recording: Any = None
        try:
            self._wait_for(data, page)
            self.recording = sdk.RecordingStream(name)
            self.recording.connect_grpc(f"rerun+http://{hidden}:{data[1]}/proxy")
            self._front = Front(listener, {each.lower() for each in names}, data, page)
        except BaseException:
            listener.close()
            self.close()
            raise

    def __enter__(self) -> "Server":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def problem(self) -> str:
        """Why nothing is shown any more; empty while the program runs."""
        code = self._process.poll()
        return "" if code is None else f"the program rerun has ended with exit code {code}"

    def close(self) -> None:
        """Stop serving, also if the program hangs."""
        if self._front is not None:
            self._front.close()
        if self.recording is not None:
            # Calls of the recording wait for a program that hangs.
            last = threading.Timer(FAREWELL, self._process.kill)
            last.start()
            with suppress(Exception):  # Rerun raises errors of any kind.
                self.recording.disconnect()
            last.cancel()
        self._process.kill()
        self._process.wait()
        self.recording = None

    def _wait_for(self, *addresses: Address) -> None:
        deadline = time.monotonic() + PATIENCE
        for address in addresses:
            while not _is_open(address):
                if self.problem:
                    raise ServerError(f"{self.problem}; it says above why")
                if time.monotonic() > deadline:
                    raise ServerError(f"the program rerun has not started within {PATIENCE:g} s")
                time.sleep(0.02)


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except (OSError, OverflowError) as error:
        text = f"the page cannot be served at {host}:{port}: {error}; choose another host or port"
        raise ServerError(text) from error


def _is_open(address: Address) -> bool:
    with suppress(OSError), socket.create_connection(address):
        return True
    return False
