# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Throttled logging by text.

rclpy throttles by the line of code that logs, and so drops the second of two problems that one line
logs.
"""

import time
from collections.abc import Callable


class LogThrottle:
    """Decides which texts to log: a new text at once, the same text again after a period.

    Texts may contain values that differ every time, so the number of different texts is limited.

    Args:
        period: time for which a logged text is not logged again [s].
        limit: maximum number of different texts within a period.
        clock: returns the time [s]; the default runs on while a simulation is paused.

    Example:
        >>> throttle = LogThrottle()
        >>> throttle.allow("no data"), throttle.allow("no data")
        (True, False)
    """

    def __init__(
        self, period: float = 5.0, limit: int = 50, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._period = period
        self._limit = limit
        self._clock = clock
        self._times: dict[str, float] = {}

    def allow(self, text: str) -> bool:
        """Return whether to log `text` now, and record it."""
        now = self._clock()
        self._times = {t: at for t, at in self._times.items() if now - at < self._period}
        if text in self._times or len(self._times) >= self._limit:
            return False
        self._times[text] = now
        return True
