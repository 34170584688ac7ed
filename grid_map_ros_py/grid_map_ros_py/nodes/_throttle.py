# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A log that stays readable while bad messages keep coming.

rclpy throttles by the line of code that logs, which loses the second of two problems that are
logged there. Here the text counts.
"""

import time
from collections.abc import Callable


class LogThrottle:
    """Selects the texts to log: a new one at once, the same one again only after a while.

    Texts may hold values that differ every time, so different ones have a limit, too.

    Args:
        period: for how long a text that was logged is not logged again [s].
        limit: maximum number of different texts logged within a period.
        clock: returns the time [s]; the default goes on while a simulation is paused.
    """

    def __init__(
        self, period: float = 5.0, limit: int = 50, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._period = period
        self._limit = limit
        self._clock = clock
        self._times: dict[str, float] = {}

    def allow(self, text: str) -> bool:
        """Tell whether to log `text`, and take it as logged if so."""
        now = self._clock()
        self._times = {t: at for t, at in self._times.items() if now - at < self._period}
        if text in self._times or len(self._times) >= self._limit:
            return False
        self._times[text] = now
        return True
