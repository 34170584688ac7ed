# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Groups of processes that start and stop together.

Imports only fast modules, so that the handlers of signals are installed early.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import partial
from types import FrameType

PATIENCE = 5.0
"""Maximum time for a process to stop before it is killed [s]."""


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
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._stop)
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            if process.poll() is None:
                # Unlike SIGINT, this prints nothing while Python is still starting.
                process.terminate()
        deadline = time.monotonic() + PATIENCE
        for process in self._processes.values():
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def start(self, module: str, arguments: Sequence[str]) -> None:
        """Start `python -m module arguments`, unless the group has been stopped."""
        if not self.stopped:
            self._processes[module] = subprocess.Popen(
                [sys.executable, "-m", module, *arguments],
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                preexec_fn=partial(_die_with_parent, os.getpid()),
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


def _die_with_parent(parent: int) -> None:
    """Make Linux terminate this process when its parent ends for any reason."""
    import ctypes

    set_parent_death_signal = 1
    ctypes.CDLL(None).prctl(set_parent_death_signal, signal.SIGTERM)
    # The parent may have ended already. It may also be process 1, for example in a container.
    if os.getppid() != parent:
        os._exit(0)
