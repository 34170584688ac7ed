# SPDX-License-Identifier: BSD-3-Clause
"""Signals that end a program."""

import ctypes
import os
import signal
from collections.abc import Callable
from types import FrameType
from typing import Any, TypeAlias

Handler: TypeAlias = Callable[[int, FrameType | None], Any] | signal.Handlers


def on_end(handler: Handler) -> dict[signal.Signals, Any]:
    """Set the handler of SIGINT, SIGTERM and SIGHUP, and return the handlers before.

    A SIGHUP that is ignored, as under `nohup`, stays ignored.
    A handler must not use locks such as those of `threading.Event`: the thread that it interrupts
    may hold them.
    """
    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    return {number: signal.signal(number, handler) for number in numbers}


def die_with_parent(number: signal.Signals = signal.SIGKILL) -> Callable[[], None]:
    """Return a `preexec_fn` that makes Linux send this signal when the parent's thread ends."""
    set_parent_death_signal = 1
    # Loaded here, since the new process may do little before its program starts.
    parent, control = os.getpid(), ctypes.CDLL(None).prctl

    def prepare() -> None:
        control(set_parent_death_signal, number)
        # The parent may have ended already. It may also be process 1, for example in a container.
        if os.getppid() != parent:
            os._exit(0)

    return prepare
