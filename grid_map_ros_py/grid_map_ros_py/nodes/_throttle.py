# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Throttled logging by text."""

import time
from collections.abc import Callable
from typing import Any


class LogThrottle:
    """Logs a new text at once, and the same text again after a period.

    (rclpy throttles by the line of code that logs, and so drops the second of two problems that one
    line logs.) Texts may contain values that differ every time, so the number of different texts is
    limited.

    Args:
        logger: logger of the node.
        period: time for which a logged text is not logged again [s].
        limit: maximum number of different texts within a period.
        clock: returns the time [s]; the default runs on while a simulation is paused.
    """

    def __init__(
        self,
        logger: Any,
        period: float = 5.0,
        limit: int = 50,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._logger = logger
        self._period = period
        self._limit = limit
        self._clock = clock
        self._times: dict[str, float] = {}

    def error(self, text: str) -> None:
        """Log an error, unless it was logged recently."""
        if self._is_due(text):
            self._logger.error(text)

    def warning(self, text: str) -> None:
        """Log a warning, unless it was logged recently."""
        if self._is_due(text):
            self._logger.warning(text)

    def _is_due(self, text: str) -> bool:
        now = self._clock()
        self._times = {t: at for t, at in self._times.items() if now - at < self._period}
        if text in self._times or len(self._times) >= self._limit:
            return False
        self._times[text] = now
        return True
