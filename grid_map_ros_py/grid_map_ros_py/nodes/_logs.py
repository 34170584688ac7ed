# SPDX-License-Identifier: BSD-3-Clause
"""Throttled logging, and errors after which a node goes on."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from grid_map_core_py.errors import cut

from ..errors import DROPPED, NodeFailedError, reason


class LogThrottle:
    """Logs similar texts at most once per period, with the number of those held back.

    Texts are similar if they are equal up to their second colon, such as "get_grid_map: frame_id:
    expected ...". At most `LIMIT` different texts are logged per period. (rclpy throttles per line
    of code, and so drops the second of two problems that one line logs.)

    Args:
        logger: logger of the node.
        period: time between two similar texts [s].
        clock: returns the time [s]; the default runs on while a simulation is paused.
    """

    LIMIT = 20

    def __init__(
        self, logger: Any, period: float = 1.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._logger, self._period, self._clock = logger, period, clock
        self._recent: dict[tuple[str, ...], tuple[float, int]] = {}

    def error(self, text: str) -> None:
        """Log an error, unless a similar one was logged recently."""
        if line := self._line(text, "error"):
            self._logger.error(line)

    def warning(self, text: str) -> None:
        """Log a warning, unless a similar one was logged recently."""
        if line := self._line(text, "warning"):
            self._logger.warning(line)

    def info(self, text: str) -> None:
        """Log a change, unless a similar one was logged recently."""
        if line := self._line(text, "info"):
            self._logger.info(line)

    def _line(self, text: str, level: str) -> str:
        """Return the line to log now, or an empty text; count what is held back."""
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
    """Log `what` with the reason if the context raises a `GridMapError` or a `MemoryError`.

    A `NodeFailedError` and all other exceptions pass.
    """
    try:
        yield
    except NodeFailedError:
        raise
    except DROPPED as error:
        log.error(f"{what}: {reason(error)}")
