# SPDX-License-Identifier: BSD-3-Clause
"""Entry point, base class and timers of node executables."""

import gc
import os
import signal
import sys
from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import NameValidationException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.timer import Timer
from rclpy.utilities import ok, try_shutdown

from grid_map_core_py._commands import on_end
from grid_map_core_py._loops import logger as loops
from grid_map_core_py.errors import GridMapError, cut
from grid_map_core_py.plugins import check

from ..errors import NodeFailedError
from ._health import PERIOD, health_of
from ._parameters import (
    check_topic,
    read_limits,
    read_parameter,
    unknown_parameters,
    unmatched_files,
)
from ._profile import use_profile

_ARGUMENT_ERRORS = (rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError)

_MIGRATION = (
    ". Parameter files of ROS 1 need another form: "
    "https://github.com/grid-map-py/grid_map_py/blob/main/docs/migration_ros1.md#parameters"
)

T = TypeVar("T")
N = TypeVar("N", int, float)

EXTREMES = (1e-9, 1e9)
"""Smallest and largest value in `read_positive`, so that rates give valid ROS timer periods."""

_WAKE_PERIOD = 0.1
"""Time between two checks for signals while a node waits for messages [s]."""


def run(create_node: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """Create a node, run it until an interrupt or a shutdown, and return the exit code.

    Call this function in the main thread. The first SIGINT, SIGTERM or SIGHUP ends the node after
    the current callback. A second signal interrupts the callback and ends the process. Under
    `nohup`, SIGHUP is ignored.

    A `NodeFailedError` from a callback is logged. Also logged are a `GridMapError` and a ROS error
    from `create_node`, such as an invalid name. All other exceptions propagate. A warning lists
    parameters that are set but not declared. The node reports its state on `/diagnostics`.

    Args:
        create_node: class of the node, or a function that returns the node.
        args: command-line arguments; None means `sys.argv`.

    Returns:
        0 after an interrupt or a shutdown, and 1 after a logged error.
    """
    life = _Life(sys.argv if args is None else list(args))
    try:
        life.start(create_node)
        life.spin()
    except KeyboardInterrupt:
        pass
    except Exception as error:
        life.fail(error)
        return 1
    finally:
        life.end()
    return 0


def steady_timer(node: Node, period: float, callback: Callable[[], object]) -> Timer:
    """Create a timer that calls `callback` every `period` [s], even if simulated time is paused."""
    return node.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


class ConfiguredNode(Node):
    """Base class of nodes that read their parameters in `__init__`.

    The base class reads the map limits. Use `main` as the entry point of the executable.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        read_limits(self)

    @classmethod
    def main(cls) -> int:
        """Run the node until an interrupt or a shutdown; return the exit code."""
        return run(cls)

    def read(self, name: str, default: T, description: str) -> T:
        """Read a parameter with the type of its default value."""
        return read_parameter(self, name, type(default), default, description=description)

    def read_number(self, name: str, default: N, low: float, high: float, description: str) -> N:
        """Read a numeric parameter in the range from `low` to `high`."""
        value = self.read(name, default, description)
        check(low <= value <= high, name, f"a number from {low:g} to {high:g}", value)
        return value

    def read_positive(self, name: str, default: float, description: str) -> float:
        """Read a positive numeric parameter, such as a rate or a duration."""
        value, (low, high) = self.read(name, default, description), EXTREMES
        check(low <= value <= high, name, f"a positive number from {low:g} to {high:g}", value)
        return value

    def read_choice(
        self, name: str, choices: Collection[str], default: str, description: str
    ) -> str:
        """Read a parameter whose value must be one of `choices`."""
        value = self.read(name, default, description)
        check(value in choices, name, f"one of {', '.join(choices)}", value)
        return value

    def read_topic(self, name: str, default: str, description: str) -> str:
        """Read a topic or service name, which may be empty only if the default is empty."""
        topic = self.read(name, default, description)
        return check_topic(self, name, topic) if topic or default else ""


class _Life:
    def __init__(self, args: list[str]) -> None:
        self._args = args
        self._node: Any = None
        self._signals, self._is_up = 0, False
        on_end(self._on_signal)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._signals += 1
        if self._signals > 1:
            raise KeyboardInterrupt

    def start(self, create_node: Callable[[], Node]) -> None:
        """Create the node; convert errors that the user can fix to `NodeFailedError`."""
        use_profile()
        loops.addFilter(lambda record: self._logger().info(record.getMessage()) and False)
        # The handlers of rclpy shut ROS down in a callback, which the executor may not notice.
        try:
            rclpy.init(args=self._args, signal_handler_options=SignalHandlerOptions.NO)
        except _ARGUMENT_ERRORS as error:
            has_file = "--params-file" in self._args
            hint = f". Write an empty mapping as []{_MIGRATION}" if has_file else ""
            if "Sequence should be of same type" in str(error):
                names = "Name the items of a list of mappings: filter1, filter2, ..."
                hint = f". {names}{_MIGRATION if has_file else ''}"
            raise NodeFailedError(f"{error}{hint}") from error
        try:
            if isinstance(create_node, type):
                # Allocate the node first, so that it can log errors of its constructor.
                self._node = object.__new__(create_node)
                self._node.__init__()
            else:
                self._node = create_node()
        except (GridMapError, NameValidationException, rclpy_implementation.RCLError) as error:
            text = str(error)
            if isinstance(error, NameValidationException):
                # The last line of the message is only a caret that marks the invalid character.
                text = text.rpartition("\n")[0]
            if not isinstance(error, GridMapError):
                text = " ".join(text.split())
            if self._is_made() and (hint := unmatched_files(self._node, self._args)):
                text = f"{text}; {hint}"
            raise NodeFailedError(text) from error
        self._is_up, node = True, self._node
        for find in (unmatched_files, unknown_parameters):
            if text := find(node, self._args):
                node.get_logger().warning(cut(text))
        health = health_of(node)
        health.offer(node)
        steady_timer(node, PERIOD, partial(health.report, node))

    def spin(self) -> None:
        """Process callbacks until a signal or a shutdown."""
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        try:
            while ok() and not self._signals:
                executor.spin_once(timeout_sec=_WAKE_PERIOD)
        except (ExternalShutdownException, KeyboardInterrupt):
            pass
        finally:
            on_end(signal.SIG_IGN)
            # Otherwise, garbage collection may first destroy parts of the executor and then fail.
            executor.shutdown()

    def fail(self, error: Exception) -> None:
        """Publish an error on `/diagnostics`; log a `NodeFailedError`, and raise other errors."""
        on_end(signal.SIG_IGN)
        if self._signals > 1:
            return  # The second signal caused the error, for example an import that it interrupted.
        if isinstance(error, NodeFailedError):
            self._logger().fatal(str(error))
        if self._is_made():
            health_of(self._node).report_failure(self._node, str(error) or repr(error))
        if not isinstance(error, NodeFailedError):
            raise error

    def end(self) -> None:
        """Destroy the node and shut ROS down, ignoring signals."""
        on_end(signal.SIG_IGN)
        if self._is_up:
            self._node.destroy_node()
        try_shutdown()
        if self._signals > 1:
            # A compiled module whose import was interrupted may crash the end of the interpreter.
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(0)
        # Skip the final garbage collection of Python, which takes half a second with numba.
        gc.freeze()

    def _logger(self) -> Any:
        """Return the logger of the node or, until it exists, a logger named after the program."""
        program = Path(sys.argv[0]).stem or "grid_map"
        return self._node.get_logger() if self._is_made() else get_logger(program)

    def _is_made(self) -> bool:
        """Return whether the base class of the node has been initialized."""
        return hasattr(self._node, "_logger")
