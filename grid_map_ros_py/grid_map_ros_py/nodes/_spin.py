# SPDX-License-Identifier: BSD-3-Clause
"""Run a node as an executable, from its arguments to its exit code; timers of nodes."""

import gc
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from traceback import walk_tb
from types import FrameType
from typing import Any

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
from grid_map_core_py.errors import GridMapError, cut

from ..errors import NodeFailedError, reason
from ._failures import is_out_of_memory
from ._health import PERIOD, health_of
from ._overrides import unknown_parameters, unmatched_files
from ._profile import use_profile
from ._throttle import LogThrottle

_ARGUMENT_ERRORS = (rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError)

_NO_FILE_OF_ROS_2 = ("before ros__parameters", "Sequences can only be values")
"""Parts of the errors of rcl about parameters that are not below `ros__parameters`, and chains."""

_MIGRATION = (
    "https://github.com/grid-map-py/grid_map_py/blob/main/docs/migration_ros1.md#parameters"
)

_MOMENT = 0.01
"""Time between repetitions of an interrupt that Python ignored [s]."""

WAKE_PERIOD = 0.1
"""Time between two checks for signals while a node waits for messages [s]."""


def run(create_node: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """Create a node, spin it until an interrupt or a shutdown, and return the exit code.

    Call it in the main thread. SIGINT, SIGTERM and SIGHUP take effect between two callbacks. (The
    handlers of rclpy shut ROS down at once, in the middle of a callback, and a spinning executor
    may miss that.) A second signal interrupts the callback. A SIGHUP that is ignored, as under
    `nohup`, stays ignored. If memory runs out, the node logs it and goes on. The node reports its
    state on `/diagnostics`, as `Health` has it.

    Args:
        create_node: class of the node, or a function that makes it. A `GridMapError` that it
            raises, or an error of ROS (a name, missing keys), is logged as one message: the
            configuration is wrong. So is a `NodeFailedError` of a callback. Other exceptions pass
            through. Given parameters that the node has not declared are warned of.
        args: command line arguments; None means those of the process.

    Returns:
        0 after an interrupt or a shutdown; 1 if the arguments or the configuration are wrong or the
        node gave up.
    """
    signals = _Signals()
    node = None
    try:
        node = _start(create_node, sys.argv if args is None else list(args))
        _spin(node, signals)
    except Exception as error:
        signals.ignore()
        failed, is_expected = _node_of(error), isinstance(error, NodeFailedError)
        if is_expected:
            name = Path(sys.argv[0]).stem or "grid_map"
            logger = get_logger(name) if failed is None else failed.get_logger()
            logger.fatal(str(error))
        if failed is not None:
            health_of(failed).report_failure(failed, str(error) or repr(error))
        if not is_expected:
            raise
        return 1
    except KeyboardInterrupt:
        pass
    finally:
        signals.ignore()
        if node is not None:
            node.destroy_node()
        try_shutdown()
        # Python collects garbage several times as it ends: half a second with numba, and far more
        # on a busy machine, while signals are ignored.
        gc.freeze()
    return 0


def steady_timer(node: Node, period: float, callback: Callable[[], object]) -> Timer:
    """Call back every `period` [s], also while a simulation, and the node's clock, is paused."""
    return node.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


class _Signals:
    """Counts signals; the second one interrupts the program.

    Python ignores exceptions in finalizers and in functions that C calls, such as LLVM while it
    compiles. An interrupt that comes there is repeated a moment later. What else is ignored then is
    not reported: an interrupt leaves objects half made, whose finalizers fail.
    """

    def __init__(self) -> None:
        self.count = 0
        self._may_break_off = True
        on_end(self._take_note)
        self._on_ignored, sys.unraisablehook = sys.unraisablehook, self._repeat

    def ignore(self) -> None:
        """Ignore signals while the process ends, when Python removes its own handlers."""
        self._may_break_off = False
        signal.setitimer(signal.ITIMER_REAL, 0)
        on_end(signal.SIG_IGN)
        sys.unraisablehook = self._on_ignored if self.count < 2 else lambda _: None

    def _repeat(self, ignored: Any) -> None:
        if self.count < 2:
            self._on_ignored(ignored)
            return
        signal.signal(signal.SIGALRM, self._take_note)
        signal.setitimer(signal.ITIMER_REAL, _MOMENT, _MOMENT)
        # The last step, since here an interrupt would be ignored again.
        self._may_break_off = True

    def _take_note(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1
        if self.count > 1 and self._may_break_off:
            self._may_break_off = False
            raise KeyboardInterrupt


def _start(create_node: Callable[[], Node], args: list[str]) -> Node:
    """Return the node; whatever its user may have done wrong becomes a `NodeFailedError`."""
    use_profile()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except _ARGUMENT_ERRORS as error:
        is_of_ros_1 = any(text in str(error) for text in _NO_FILE_OF_ROS_2)
        hint = f". ROS 2 needs another form than ROS 1: {_MIGRATION}" if is_of_ros_1 else ""
        raise NodeFailedError(f"{error}{hint}") from error
    try:
        node = create_node()
    except (GridMapError, NameValidationException, rclpy_implementation.RCLError) as error:
        text = str(error)
        if isinstance(error, NameValidationException):
            # The last line is only a caret below the line before.
            text = text.rpartition("\n")[0]
        if not isinstance(error, GridMapError):
            text = " ".join(text.split())
        unfinished = _node_of(error)
        hint = unmatched_files(unfinished, args) if unfinished else ""
        raise NodeFailedError(f"{text}; {hint}" if hint else text) from error
    for text in (unmatched_files(node, args), unknown_parameters(node, args)):
        if text:
            node.get_logger().warning(cut(text))
    health = health_of(node)
    health.offer(node)
    steady_timer(node, PERIOD, partial(health.report, node))
    return node


def _node_of(error: BaseException | None) -> Node | None:
    """Return the node in whose code an error or its cause was raised."""
    while error is not None:
        for frame, _ in walk_tb(error.__traceback__):
            for value in frame.f_locals.values():
                if isinstance(value, Node) and hasattr(value, "_logger"):
                    return value
        error = error.__cause__
    return None


class _Executor(SingleThreadedExecutor):
    """Logs that memory ran out, and goes on with the next callback.

    Args:
        node: the only node.
    """

    def __init__(self, node: Node) -> None:
        super().__init__()
        self._log = LogThrottle(node.get_logger())
        self.add_node(node)

    def _make_handler(self, entity: Any, node: Node, take: Callable[[Any], Any]) -> Any:
        """Return what takes a message or a request, and calls back.

        An exception while it is taken would leave rclpy's callback group blocked for good.
        """

        def take_if_possible(taken: Any) -> Any:
            with self._surviving():
                callback = take(taken)
                return callback and partial(self._call, callback)

        return super()._make_handler(entity, node, take_if_possible)

    async def _call(self, callback: Callable[[], Any]) -> None:
        with self._surviving():
            await callback()

    @contextmanager
    def _surviving(self) -> Iterator[None]:
        try:
            yield
        except (MemoryError, RuntimeError) as error:
            if not is_out_of_memory(error):
                raise
            self._log.error(f"dropped a message or a request: {reason(error)}")


def _spin(node: Node, signals: _Signals) -> None:
    executor = _Executor(node)
    try:
        while ok() and not signals.count:
            executor.spin_once(timeout_sec=WAKE_PERIOD)
    except (ExternalShutdownException, KeyboardInterrupt):
        pass
    finally:
        # In the garbage collector its parts may already be gone, which would print a traceback.
        executor.shutdown()
