# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Test helper: kills a process at every step of its work."""

import itertools
import os
import signal
import sys
from collections.abc import Callable, Iterator


def killed_at_every_step(work: Callable[[], object], limit: int = 1000) -> Iterator[int]:
    """Run `work` in copies of this process, and kill each copy one step later than the last.

    A step is what Python announces to audit hooks: opening, renaming and removing files, making
    folders and so on. The last copy is not killed, because it has finished.

    Args:
        work: operation to run.
        limit: maximum number of steps.

    Yields:
        The number of the step before which the copy has died.
    """
    for step in range(limit):
        process = os.fork()
        if process == 0:
            _die_before(step)
            work()
            os._exit(0)
        _, status = os.waitpid(process, 0)
        yield step
        if os.WIFEXITED(status):
            return
    raise AssertionError(f"more than {limit} steps")


def _die_before(step: int) -> None:
    count = itertools.count()

    def die(event: str, _: object) -> None:
        watched = event.startswith(("os.", "fcntl.", "shutil.", "open", "ctypes.call"))
        if watched and next(count) == step:
            os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(die)
