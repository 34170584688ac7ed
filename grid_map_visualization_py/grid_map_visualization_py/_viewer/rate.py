# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Rate of incoming maps and age of the last one."""

import math
from collections import deque


class MapRate:
    """Counts maps by their arrival times.

    Args:
        window: duration over which the rate is averaged [s].
    """

    def __init__(self, window: float = 3.0) -> None:
        self._window = window
        self._times: deque[float] = deque()

    def add(self, now: float) -> None:
        """Record a map that arrived at the time `now` [s]."""
        self._times.append(now)
        while now - self._times[0] > self._window:
            self._times.popleft()

    def rate(self, now: float) -> float:
        """Return maps per second; 0 with fewer than two maps in the window."""
        times = [time for time in self._times if now - time <= self._window]
        return (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0

    def age(self, now: float) -> float:
        """Return the seconds since the last map; infinite if there is none."""
        return now - self._times[-1] if self._times else math.inf
