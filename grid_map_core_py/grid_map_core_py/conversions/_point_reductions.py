# SPDX-License-Identifier: BSD-3-Clause
"""Reductions of the points of each cell to one value.

A reducer takes points in chunks and then returns, once, one float32 value per cell, NaN
without points. Chunks keep temporaries small, and a reducer needs memory for cells only, except for
the median. All rest on `ufunc.at`, which takes a few nanoseconds per point and honors cells that
occur more than once.
"""

from collections.abc import Callable, Mapping
from typing import Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from .._arrays._checks import Integers
from ._packed_colors import color_value_to_bytes, join_channels
from ._point_loops import add_up, keep_largest, keep_smallest, make_keys, middles, ready

Flat = npt.NDArray[np.float32]
"""(cells,) one value per cell."""

Values = npt.NDArray[np.float64]
"""(n,) values of a chunk of points, all finite, or colors."""


class Reducer(Protocol):
    """Reduces the values of points to one value per cell."""

    def add(self, cells: Integers, values: Values) -> None:
        """Add (n,) values of points; `cells` (n,) are the flat numbers of their cells."""

    def result(self) -> Flat:
        """Return one value per cell. Nothing can be added afterwards."""


MakeReducer: TypeAlias = Callable[[int, int], Reducer]
"""Returns a reducer for numbers of cells and of points."""


class Extreme:
    """The largest value with `np.fmax`, the smallest with `np.fmin`."""

    def __init__(self, cells: int, choose: np.ufunc) -> None:
        self._choose = choose
        self._loop = ready(keep_largest if choose is np.fmax else keep_smallest)
        self._layer = np.full(cells, np.nan, np.float32)

    def add(self, cells: Integers, values: Values) -> None:
        # Rounding to float32 keeps the order of values.
        if self._loop:
            self._loop(cells, values, len(cells), self._layer)
            return
        self._choose.at(self._layer, cells, values.astype(np.float32))

    def result(self) -> Flat:
        return self._layer


class Last:
    """The value of the last point."""

    def __init__(self, cells: int) -> None:
        self._layer = np.full(cells, np.nan, np.float32)
        self._chosen = np.empty(cells, np.int32)

    def add(self, cells: Integers, values: Values) -> None:
        # A plain assignment guarantees no order if a cell occurs more than once.
        numbers = np.arange(len(cells), dtype=np.int32)
        self._chosen[cells] = -1
        np.maximum.at(self._chosen, cells, numbers)
        chosen = self._chosen[cells] == numbers
        self._layer[cells[chosen]] = values[chosen]

    def result(self) -> Flat:
        return self._layer


class First(Last):
    """The value of the first point: the last one of the reversed order."""

    def add(self, cells: Integers, values: Values) -> None:
        new = np.isnan(self._layer[cells])
        super().add(cells[new][::-1], values[new][::-1])


class Count:
    """The number of points; 0 without points."""

    def __init__(self, cells: int) -> None:
        self.numbers = np.zeros(cells, np.int32)

    def add(self, cells: Integers, values: Values) -> None:
        np.add.at(self.numbers, cells, np.ones(len(values), np.int32))

    def result(self) -> Flat:
        return self.numbers.astype(np.float32)


class Mean:
    """The mean."""

    def __init__(self, cells: int) -> None:
        self._sums = np.zeros(cells)
        self._count = Count(cells)
        self._loop = ready(add_up)

    def add(self, cells: Integers, values: Values) -> None:
        if self._loop:
            self._loop(cells, values, len(cells), self._sums, self._count.numbers)
            return
        np.add.at(self._sums, cells, values)
        self._count.add(cells, values)

    def result(self) -> Flat:
        self._sums /= self._count.numbers
        del self._count
        return self._sums.astype(np.float32)


class Variance:
    """The population variance: the mean squared deviation from the mean.

    Deviations are relative to a value of the same cell, so that a common height costs no
    digits from them (Chan, Golub and LeVeque, "Algorithms for Computing the Sample Variance",
    1983).
    """

    def __init__(self, cells: int) -> None:
        self._references = np.full(cells, np.nan, np.float32)
        self._sums, self._squares = np.zeros(cells), np.zeros(cells)
        self._count = Count(cells)

    def add(self, cells: Integers, values: Values) -> None:
        new = np.isnan(self._references[cells])
        self._references[cells[new]] = values[new]
        deviations = values - self._references[cells]
        np.add.at(self._sums, cells, deviations)
        np.add.at(self._squares, cells, deviations * deviations)
        self._count.add(cells, values)

    def result(self) -> Flat:
        del self._references
        self._sums /= self._count.numbers
        self._squares /= self._count.numbers
        self._sums *= self._sums
        self._squares -= self._sums
        # Rounding may leave a small negative number.
        return np.maximum(self._squares, 0.0, out=self._squares).astype(np.float32)


class Median:
    """The median of the values as float32; for an even count the mean of the middle two.

    A key of 64 bits per point, its cell above its value, sorts points by cell and by value in one
    go, more than ten times as fast as `np.lexsort`.
    """

    def __init__(self, cells: int, points: int) -> None:
        self._count = Count(cells)
        self._keys = np.empty(points, np.uint64)
        self._seen = 0

    def add(self, cells: Integers, values: Values) -> None:
        keys = self._keys[self._seen : self._seen + len(cells)]
        self._seen += len(cells)
        bits = values.astype(np.float32).view(np.uint32)
        if make := ready(make_keys):
            make(cells, bits, len(cells), keys, self._count.numbers)
            return
        keys[...] = cells
        keys <<= np.uint64(32)
        # Integers that sort like the values.
        keys |= np.where(bits & _SIGN, ~bits, bits | _SIGN)
        self._count.add(cells, values)

    def result(self) -> Flat:
        keys = self._keys[: self._seen]
        numbers = self._count.numbers
        occupied = np.flatnonzero(numbers)
        counts = numbers[occupied].astype(np.int64)
        ends = np.cumsum(counts)
        find = ready(middles)
        if find and counts.max(initial=0) <= _FEW:
            lower, upper = np.empty((2, counts.size), np.uint32)
            dealt, places = np.empty(keys.size, np.uint32), np.empty(numbers.size, np.int64)
            places[occupied] = ends - counts
            find(keys, keys.size, places, counts.size, ends, dealt, lower, upper)
        else:
            keys.sort()
            upper = keys[ends - counts + counts // 2].astype(np.uint32)
            lower = keys[ends - (counts + 2) // 2].astype(np.uint32)
        layer = np.full(numbers.size, np.nan, np.float32)
        layer[occupied] = 0.5 * (_unsortable(lower).astype(np.float64) + _unsortable(upper))
        return layer


class MeanColor:
    """The mean of each channel of packed colors, rounded."""

    def __init__(self, cells: int) -> None:
        self._sums = [np.zeros(cells, np.uint32) for _ in "rgb"]
        self._count = Count(cells)

    def add(self, cells: Integers, values: Values) -> None:
        for sums, channel in zip(self._sums, color_value_to_bytes(values), strict=True):
            np.add.at(sums, cells, channel.astype(np.uint32))
        self._count.add(cells, values)

    def result(self) -> Flat:
        numbers = self._count.numbers.astype(np.uint32)
        for sums in self._sums:
            sums += numbers // 2
            sums //= numbers
        colors: Flat = join_channels(*self._sums).view(np.float32)
        colors[numbers == 0] = np.nan
        return colors


_SIGN = np.uint32(1 << 31)


_FEW = 64
"""Points in a cell that are sorted by insertion, whose time grows with the square."""


def _unsortable(bits: npt.NDArray[np.uint32]) -> npt.NDArray[np.float32]:
    """Return the values of integers that sort like them."""
    return np.where(bits & _SIGN, bits ^ _SIGN, ~bits).view(np.float32)


REDUCERS: Mapping[str, MakeReducer] = {
    "max": lambda cells, _: Extreme(cells, np.fmax),
    "min": lambda cells, _: Extreme(cells, np.fmin),
    "mean": lambda cells, _: Mean(cells),
    "median": Median,
    "first": lambda cells, _: First(cells),
    "last": lambda cells, _: Last(cells),
    "count": lambda cells, _: Count(cells),
    "variance": lambda cells, _: Variance(cells),
}

COLOR_REDUCERS: Mapping[str, MakeReducer] = {
    "mean": lambda cells, _: MeanColor(cells),
    **{name: REDUCERS[name] for name in ("first", "last", "count")},
}
"""Reducers of packed colors, whose bits mean nothing as numbers."""
