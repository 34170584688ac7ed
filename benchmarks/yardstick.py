# SPDX-License-Identifier: BSD-3-Clause
"""Yardstick: the current speed of one core.

The same number was taken beside the C++ timings. Dividing by it makes times comparable that were
measured on different machines or at different hours.
"""

import statistics
import time

import numpy as np

PASSES = 20


def yardstick(repeats: int = 9) -> float:
    """Return the median milliseconds of 20 running sums over 200,000 doubles."""
    values = np.linspace(0.0, 1.0, 200_000)
    sums = np.empty_like(values)
    return 1e3 * statistics.median(_seconds(values, sums) for _ in range(repeats))


def _seconds(values: np.ndarray, sums: np.ndarray) -> float:
    begin = time.perf_counter()
    for _ in range(PASSES):
        np.cumsum(values, out=sums)
    return time.perf_counter() - begin
