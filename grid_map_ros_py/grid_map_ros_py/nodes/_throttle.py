# SPDX-License-Identifier: BSD-3-Clause
"""Throttled logging by cause."""

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from weakref import WeakSet

from grid_map_core_py.errors import cut

_QUOTED = re.compile(r"""'[^']*'?|"[^"]*"?""")
_VARYING = re.compile(r"[\d/]")


class LogThrottle:
    """Logs a text at once, and texts of the same cause at most once per period, with their number.

    Texts have the same cause if they differ in quoted values and in words with digits or slashes
    only. Beyond `limit` causes within a period, all others count as one. (rclpy throttles by the
    line of code that logs, and so drops the second of two problems that one line logs.)

    Args:
        logger: logger of the node.
        period: time between two lines of one cause [s].
        limit: maximum number of causes.
        clock: returns the time [s]; the default runs on while a simulation is paused.
    """

    def __init__(
        self,
        logger: Any,
        period: float = 1.0,
        limit: int = 10,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._logger = logger
        self._period = period
        self._limit = limit
        self._clock = clock
        self._causes: dict[tuple[str, str], _Cause] = {}
        _throttles.add(self)

    def error(self, text: str) -> None:
        """Log an error, unless its cause was logged recently."""
        self._note(cut(text), "error")

    def warning(self, text: str) -> None:
        """Log a warning, unless its cause was logged recently."""
        self._note(cut(text), "warning")

    def info(self, text: str) -> None:
        """Log a change, unless its cause was logged recently."""
        self._note(cut(text), "info")

    def flush(self) -> None:
        """Log what is held back of causes whose period is over."""
        now = self._clock()
        for key, cause in [*self._causes.items()]:
            if now - cause.time < self._period:
                continue
            if not cause.count:
                del self._causes[key]
                continue
            more = f" (and {cause.count - 1} more like this)" if cause.count > 1 else ""
            # rclpy refuses two levels in one line of code.
            if key[0] == "error":
                self._logger.error(cause.text + more)
            elif key[0] == "warning":
                self._logger.warning(cause.text + more)
            else:
                self._logger.info(cause.text + more)
            cause.count, cause.time = 0, now

    def _note(self, text: str, level: str) -> None:
        words = _QUOTED.sub("", text).split()
        key = level, " ".join(word for word in words if not _VARYING.search(word))
        if key not in self._causes and len(self._causes) >= self._limit:
            key = level, ""
        cause = self._causes.setdefault(key, _Cause())
        cause.text = text
        cause.count += 1
        self.flush()


@dataclass
class _Cause:
    """Texts of one cause: the last one, their number and the time since the last line."""

    text: str = ""
    count: int = 0
    time: float = -math.inf


_throttles: WeakSet[LogThrottle] = WeakSet()


def flush_logs() -> None:
    """Log what all throttles of the process hold back and may log by now."""
    for throttle in [*_throttles]:
        throttle.flush()
