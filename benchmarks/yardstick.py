# SPDX-License-Identifier: BSD-3-Clause
"""Yardstick: the time of a fixed computation, as a measure of the current speed of one core.

The C++ timings were taken together with the same yardstick. Times divided by the yardstick are
comparable between machines and between runs.
"""

import statistics
import time

import numpy as np

PASSES = 20


def yardstick(repeats: int = 9) -> float:
    """Return the median time of 20 cumulative sums over 200,000 doubles [ms]."""
    values = np.linspace(0.0, 1.0, 200_000)
    sums = np.empty_like(values)
    return 1e3 * statistics.median(_seconds(values, sums) for _ in range(repeats))


def _seconds(values: np.ndarray, sums: np.ndarray) -> float:
    begin = time.perf_counter()
    for _ in range(PASSES):
        np.cumsum(values, out=sums)
    return time.perf_counter() - begin
