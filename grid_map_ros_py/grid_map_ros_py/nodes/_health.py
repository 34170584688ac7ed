# SPDX-License-Identifier: BSD-3-Clause
"""State of a node for `/diagnostics`, and a throttled log."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.duration import Duration
from rclpy.node import Node

from grid_map_core_py.errors import cut

from ..errors import DROPPED, NodeFailedError, TiltedFrameError, reason

TOPIC = "/diagnostics"

PERIOD = 1.0
"""Time between two reports of a node [s]."""

PATIENCE = 1.0
"""Maximum wait until subscribers are discovered, and then until they acknowledge a report [s]."""


@dataclass
class Health:
    """State of a node for `/diagnostics`: input counts and errors.

    Attributes:
        inputs: plural noun for the inputs, such as "maps".
        received, used, dropped: number of received, processed and unusable inputs.
        last_error: reason why the last unusable input was dropped; empty if no input was dropped.
        problem: current problem other than unusable inputs; empty if there is none.
        details: function that returns additional values for the report, by name.
        drop_level: diagnostic level that is reported if the last input was dropped.
    """

    inputs: str = "maps"
    received: int = 0
    used: int = 0
    dropped: int = 0
    last_error: str = ""
    problem: str = ""
    details: Callable[[], Mapping[str, object]] = dict
    drop_level: bytes = DiagnosticStatus.WARN
    _last_was_dropped: bool = False
    _is_deferred: bool = False
    _last_time: float = math.nan
    _publisher: Any = None
    _discovered: float = math.inf

    @contextmanager
    def counted(self) -> Iterator[None]:
        """Count an input as used, or as dropped if the context raises an error."""
        self.receive()
        self._is_deferred = False
        try:
            yield
        except Exception as error:
            self.drop(reason(error))
            raise
        if not self._is_deferred:
            self.use()

    def defer(self) -> None:
        """Keep the current input waiting; `use` or `drop` counts it later."""
        self._is_deferred = True

    def receive(self) -> None:
        self.received += 1
        self._last_time = time.monotonic()

    def use(self, count: int = 1) -> None:
        self.used += count
        self._last_was_dropped = False

    def drop(self, why: str) -> None:
        self.dropped += 1
        self._last_was_dropped, self.last_error = True, why

    def offer(self, node: Node) -> None:
        """Create the publisher on `/diagnostics`."""
        self._publisher = node.create_publisher(DiagnosticArray, TOPIC, 10)
        self._discovered = time.monotonic() + PATIENCE

    def report(self, node: Node) -> None:
        if self._publisher.get_subscription_count():
            level = DiagnosticStatus.WARN if self.problem else DiagnosticStatus.OK
            if self._last_was_dropped:
                level = self.drop_level
            text = f"{self.dropped} of {self.received} {self.inputs} dropped"
            self._publish(node, level, f"{text}; {self.problem}" if self.problem else text)

    def report_failure(self, node: Node, reason: str) -> None:
        """Publish the error that ends the node; wait up to 2 s for subscribers to receive it."""
        # A failure here must not hide the error that ends the node.
        with suppress(Exception):
            if self._publisher is None:
                self.offer(node)
            count = self._publisher.get_subscription_count
            while not count() and time.monotonic() < self._discovered:
                time.sleep(0.01)
            self._publish(node, DiagnosticStatus.ERROR, reason)
            self._publisher.wait_for_all_acked(Duration(seconds=PATIENCE))

    def _publish(self, node: Node, level: bytes, text: str) -> None:
        values = {
            f"{self.inputs} in": self.received,
            f"{self.inputs} out": self.used,
            f"{self.inputs} dropped": self.dropped,
            "last error": self.last_error,
            "seconds since the last input": f"{time.monotonic() - self._last_time:.1f}",
            **self.details(),
        }
        status = DiagnosticStatus(
            level=level,
            name=node.get_fully_qualified_name().removeprefix("/"),
            message=cut(text),
            values=[KeyValue(key=key, value=cut(str(value))) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = node.get_clock().now().to_msg()
        self._publisher.publish(message)


def health_of(node: Node) -> Health:
    """Return the `Health` of a node; the first call creates it."""
    health: Health = vars(node).setdefault("_grid_map_health", Health())
    return health


class LogThrottle:
    """Logs similar messages at most once per period [s], and counts suppressed messages.

    Messages are similar if they are equal up to the second colon. The default clock continues while
    a simulation is paused.
    """

    LIMIT = 20

    def __init__(
        self, logger: Any, period: float = 1.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._logger, self._period, self._clock = logger, period, clock
        self._recent: dict[tuple[str, ...], tuple[float, int]] = {}

    def error(self, text: str) -> None:
        if line := self._line(text, "error"):
            self._logger.error(line)

    def warning(self, text: str) -> None:
        if line := self._line(text, "warning"):
            self._logger.warning(line)

    def info(self, text: str) -> None:
        if line := self._line(text, "info"):
            self._logger.info(line)

    def _line(self, text: str, level: str) -> str:
        """Return the line to log, or "" if the message must be suppressed."""
        text, now = cut(text), self._clock()
        key = level, *text.split(": ")[:2]
        logged, held_back = self._recent.get(key, (-math.inf, 0))
        if now - logged < self._period:
            self._recent[key] = logged, held_back + 1
            return ""
        self._recent = {k: v for k, v in self._recent.items() if now - v[0] < self._period}
        if len(self._recent) == self.LIMIT:
            return ""
        self._recent[key] = now, 0
        return text + (f" (and {held_back} more before)" if held_back else "")


@contextmanager
def dropping(log: LogThrottle, what: str) -> Iterator[None]:
    """Log errors in `DROPPED`, except `NodeFailedError`, with the prefix `what`."""
    try:
        yield
    except NodeFailedError:
        raise
    except TiltedFrameError as error:
        log.warning(f"{what}: {error}")
    except DROPPED as error:
        log.error(f"{what}: {reason(error)}")
