# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The life of an executable: from its arguments to its exit code."""

import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import rclpy
from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import (
    SignalHandlerOptions,
    install_signal_handlers,
    uninstall_signal_handlers,
)
from rclpy.utilities import ok, try_shutdown

from grid_map_core_py.errors import GridMapError

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_ARGUMENT_ERRORS = (rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError)
_HANDLE_ERRORS = (rclpy_implementation.RCLError, InvalidHandle)


def run(create_node: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """Create a node, spin it until the process is told to stop, and return the exit code.

    For the `main` of an executable, in its main thread. Interrupts and requests to terminate take
    effect once the node spins: what rclpy makes or takes down while a signal shuts it down is left
    in pieces, and says so.

    Args:
        create_node: makes the node. A `GridMapError` that it raises means that the node cannot work
            as configured: it is logged as one message.
        args: command line arguments; None means those of the process.

    Returns:
        0 after an interrupt or a shutdown from outside, 1 when the arguments or the configuration
        cannot be used.
    """
    signals = _Signals()
    try:
        return _run(create_node, None if args is None else list(args), signals)
    finally:
        try_shutdown()
        signals.ignore()


class _Signals:
    """Takes note of signals, except while rclpy is allowed to act on them."""

    def __init__(self) -> None:
        self.has_come = False
        for number in _SIGNALS:
            signal.signal(number, self._take_note)

    @contextmanager
    def left_to_rclpy(self) -> Iterator[None]:
        install_signal_handlers(SignalHandlerOptions.ALL)
        try:
            yield
        finally:
            # rclpy puts those back that it found.
            uninstall_signal_handlers()

    def ignore(self) -> None:
        """Let the process end undisturbed; Python gives up handlers of its own when it ends."""
        for number in _SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    def _take_note(self, _number: int, _frame: FrameType | None) -> None:
        self.has_come = True


def _run(create_node: Callable[[], Node], args: list[str] | None, signals: _Signals) -> int:
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except _ARGUMENT_ERRORS as error:
        return _failed(error)
    try:
        _spin(create_node(), signals)
    except GridMapError as error:
        return _failed(error)
    return 0


def _spin(node: Node, signals: _Signals) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        with signals.left_to_rclpy():
            if not signals.has_come:
                executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except _HANDLE_ERRORS:
        # Whatever is created or published while a signal shuts ROS down fails with one of these.
        if ok():
            raise
    finally:
        node.destroy_node()


def _failed(error: Exception) -> int:
    get_logger(Path(sys.argv[0]).stem or "grid_map").fatal(str(error))
    return 1
