# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Start of an executable, before it handles signals."""

import sys
from types import TracebackType


def quiet_start() -> None:
    """Let Ctrl-C end this process without a traceback where nothing else handles it.

    Call it where a package of executables begins, before rclpy is imported: importing takes most of
    the time in which an executable starts. `run` handles interrupts afterwards.
    """
    sys.excepthook = _report


def _report(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> None:
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, traceback)
