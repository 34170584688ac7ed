# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The life of an executable: from its arguments to its exit code."""

import signal
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import rclpy
from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.utilities import ok, try_shutdown

from grid_map_core_py.errors import GridMapError

_ARGUMENT_ERRORS = (rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError)
_HANDLE_ERRORS = (rclpy_implementation.RCLError, InvalidHandle)


def run(create_node: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """Create a node, spin it until the process is told to stop, and return the exit code.

    For the `main` of an executable: the process should end afterwards, since interrupts are ignored
    from the first one on.

    Args:
        create_node: makes the node. A `GridMapError` that it raises means that the node cannot work
            as configured: it is logged as one message.
        args: command line arguments; None means those of the process.

    Returns:
        0 after an interrupt or a shutdown from outside, 1 when the arguments or the configuration
        cannot be used.
    """
    try:
        return _run(create_node, None if args is None else list(args))
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    finally:
        _ignore_interrupts()
        try_shutdown()


def _run(create_node: Callable[[], Node], args: list[str] | None) -> int:
    try:
        rclpy.init(args=args)
    except _ARGUMENT_ERRORS as error:
        return _failed(error)
    try:
        _spin(create_node)
    except GridMapError as error:
        return _failed(error)
    except _HANDLE_ERRORS:
        # Whatever is created or published while a signal shuts ROS down fails with one of these.
        if ok():
            raise
    return 0


def _spin(create_node: Callable[[], Node]) -> None:
    node = create_node()
    try:
        rclpy.spin(node)
    finally:
        _ignore_interrupts()
        node.destroy_node()


def _failed(error: Exception) -> int:
    get_logger(Path(sys.argv[0]).stem or "grid_map").fatal(str(error))
    return 1


def _ignore_interrupts() -> None:
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
