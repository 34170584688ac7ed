# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Signals that end a program."""

import signal
from collections.abc import Callable
from types import FrameType
from typing import Any, TypeAlias

Handler: TypeAlias = Callable[[int, FrameType | None], Any] | signal.Handlers


def on_end(handler: Handler) -> dict[signal.Signals, Any]:
    """Let a handler take the signals that end a program; return their handlers until now.

    These are SIGINT, SIGTERM and SIGHUP. A SIGHUP that is ignored, as under `nohup`, stays ignored.
    A handler must not use locks such as those of `threading.Event`: the thread that it interrupts
    may hold them.
    """
    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    return {number: signal.signal(number, handler) for number in numbers}
