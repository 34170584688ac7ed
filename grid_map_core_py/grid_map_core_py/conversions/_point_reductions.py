# SPDX-License-Identifier: BSD-3-Clause
"""Functions that reduce the point values in each cell to one value.

The arguments are the flat cell index (n,) and the value (n,) of each point, and the number of
cells. The result is one float32 per cell. In cells without points, the count is 0, and all other
results are NaN.
"""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from .._arrays._checks import Integers
from ._packed_colors import color_value_to_bytes, join_channels

_Flat: TypeAlias = npt.NDArray[np.float32]
_Values: TypeAlias = npt.NDArray[Any]
Reduction: TypeAlias = Callable[[Integers, _Values, int], _Flat]

_SIGN = np.uint32(1 << 31)


def _extreme(choose: np.ufunc) -> Reduction:
    def reduced(cells: Integers, values: _Values, size: int) -> _Flat:
        layer = np.full(size, np.nan, np.float32)
        choose.at(layer, cells, values.astype(np.float32, copy=False))
        return layer

    return reduced


def _last(cells: Integers, values: _Values, size: int) -> _Flat:
    # With plain assignment, NumPy does not guarantee that the last value of a cell is kept.
    places = np.full(size, -1)
    np.maximum.at(places, cells, np.arange(len(cells)))
    layer = np.full(size, np.nan, np.float32)
    seen = places >= 0
    layer[seen] = values[places[seen]]
    return layer


def _count(cells: Integers, _: _Values, size: int) -> _Flat:
    return np.bincount(cells, minlength=size).astype(np.float32)


def _means(cells: Integers, values: _Values, size: int) -> _Values:
    means: _Values = np.bincount(cells, values, size) / np.bincount(cells, minlength=size)
    return means


def _variance(cells: Integers, values: _Values, size: int) -> _Flat:
    deviations = values - _means(cells, values, size)[cells]
    return _means(cells, deviations * deviations, size).astype(np.float32)


def _median(cells: Integers, values: _Values, size: int) -> _Flat:
    values = np.ascontiguousarray(values, np.float32)
    layer, numbers = np.full(size, np.nan, np.float32), np.bincount(cells, minlength=size)
    # The upper half of a 64-bit key is the cell, and the lower half is the value. Sorting the keys
    # is more than ten times as fast as `np.lexsort`.
    bits = values.view(np.uint32)
    keys = cells.astype(np.uint64) << np.uint64(32)
    keys |= np.where(bits & _SIGN, ~bits, bits | _SIGN)  # integers that sort like the values
    keys.sort()
    occupied = np.flatnonzero(numbers)
    counts, ends = numbers[occupied], np.cumsum(numbers[occupied])
    total = np.zeros(len(occupied))
    for middle in (ends - counts + counts // 2, ends - (counts + 2) // 2):
        chosen = keys[middle].astype(np.uint32)
        total += np.where(chosen & _SIGN, chosen ^ _SIGN, ~chosen).view(np.float32)
    layer[occupied] = 0.5 * total
    return layer


def mean_color(cells: Integers, values: npt.NDArray[Any], size: int) -> _Flat:
    """Return the mean color of each cell, with channels rounded to integers."""
    numbers = np.bincount(cells, minlength=size)
    means = [
        (np.bincount(cells, channel, size) + numbers // 2) // np.maximum(numbers, 1)
        for channel in color_value_to_bytes(values)
    ]
    colors: _Flat = join_channels(*(mean.astype(np.uint32) for mean in means)).view(np.float32)
    colors[numbers == 0] = np.nan
    return colors


REDUCTIONS: Mapping[str, Reduction] = {
    "max": _extreme(np.fmax),
    "min": _extreme(np.fmin),
    "mean": lambda cells, values, size: _means(cells, values, size).astype(np.float32),
    "median": _median,
    "first": lambda cells, values, size: _last(cells[::-1], values[::-1], size),
    "last": _last,
    "count": _count,
    "variance": _variance,
}

COLOR_REDUCTIONS: Mapping[str, Reduction] = {
    "mean": mean_color,
    **{name: REDUCTIONS[name] for name in ("first", "last", "count")},
}
"""Reductions that support packed colors, which cannot be averaged or compared as numbers."""
