# SPDX-License-Identifier: BSD-3-Clause
"""Sorts the points of a scan by cell, and clusters points with consistent heights.

The points of a cell are visited from highest to lowest. A point of height z joins the current
cluster of mean height m if
`|z - m| <= max(threshold * sqrt(variance of m + variance of z), relief)`.
Otherwise, the point starts a new cluster. The relief is the height difference that a slope may
cause within a cell. The order of the points in the scan does not affect the results.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Integers, Mask
from .._loops import loop
from ._parameters import Numbers, Parameters

RELIEF = 0.4
"""Height difference that a slope may cause within a cell, as a multiple of the resolution."""

NONE = -1
"""Index that means "no cluster"."""


@dataclass(frozen=True)
class Sorted:
    """Points sorted by cell, then by descending height, then by variance.

    Attributes:
        order: (n,) indices of the points before sorting.
        heights, variances: (n,) heights [m] and variances [m^2] of the points.
        cells: (m,) indices of the cells that contain points, in ascending order.
        begins, ends: (m,) start and end (exclusive) of each cell's slice of the sorted points.
    """

    order: Integers
    heights: Numbers
    variances: Numbers
    cells: Integers
    begins: Integers
    ends: Integers

    @property
    def groups(self) -> Integers:
        """(n,) index into `cells` for each point."""
        return np.repeat(np.arange(len(self.cells)), self.ends - self.begins)


def sorted_by_cell(cells: Integers, heights: Numbers, variances: Numbers, size: int) -> Sorted:
    """Sort points (n,) as described in `Sorted`. The map has `size` cells."""
    if compiled := deal.compiled():
        count = len(cells)
        order, dealt = np.empty(count, np.int64), np.empty((2, count))
        borders = np.zeros(size + 1, np.int64)
        heights, variances = np.ascontiguousarray(heights), np.ascontiguousarray(variances)
        compiled(cells, (heights, variances), count, size, borders, order, (*dealt,))
        begins, ends = np.concatenate(([0], borders[: size - 1])), borders[:size]
        occupied = np.flatnonzero(ends > begins)
        return Sorted(order, dealt[0], dealt[1], occupied, begins[occupied], ends[occupied])
    order = np.lexsort((variances, -heights, cells))
    cells = cells[order]
    begins = np.flatnonzero(np.diff(cells, prepend=-1))
    ends = np.append(begins[1:], len(cells))
    return Sorted(order, heights[order], variances[order], cells[begins], begins, ends)


def in_one_order(points: Sorted, values: NDArray[Any]) -> Integers:
    """Return `points.order`, with ties in height and variance sorted by `values` (n,)."""
    order = points.order
    same = np.zeros(len(order) + 1, np.bool_)
    same[1:-1] = (np.diff(points.heights) == 0) & (np.diff(points.variances) == 0)
    same[points.begins] = False
    tied = np.flatnonzero(same[1:] | same[:-1])
    if not len(tied):
        return order
    runs = np.cumsum(~same[:-1])[tied]
    order = order.copy()
    order[tied] = order[tied[np.lexsort((values[order[tied]], runs))]]
    return order


@loop("int64*", ("float64*", 2), "int64", "int64", "int64*", "int64*", ("float64*", 2))
def deal(
    cells: Any, points: Any, count: Any, size: Any, borders: Any, order: Any, dealt: Any
) -> None:
    """Sort `count` points as described in `Sorted`; write them to `order` and `dealt`.

    `borders` (size + 1,) must contain zeros. On return, the points of cell i end before index
    `borders[i]`.
    """
    heights, variances = points
    sorted_heights, sorted_variances = dealt
    for i in range(count):
        borders[cells[i] + 1] += 1
    for cell in range(size):
        borders[cell + 1] += borders[cell]
    for i in range(count):
        place = borders[cells[i]]
        borders[cells[i]] = place + 1
        order[place] = i
        sorted_heights[place] = heights[i]
    begin = 0
    for cell in range(size):
        sort_part(begin, borders[cell], order, sorted_heights, variances)
        begin = borders[cell]
    for i in range(count):
        sorted_variances[i] = variances[order[i]]


def sort_part(begin: Any, end: Any, order: Any, heights: Any, variances: Any) -> None:
    """Sort a slice of `order` and `heights` by descending height, then by variance (Shellsort)."""
    gap = (end - begin) // 2 if end - begin > 12 else 1
    while gap > 0:
        for i in range(begin + gap, end):
            height, number = heights[i], order[i]
            place = i
            while place - gap >= begin and not heights[place - gap] > height:
                before = order[place - gap]
                if heights[place - gap] == height and variances[before] <= variances[number]:
                    break
                heights[place], order[place] = heights[place - gap], before
                place -= gap
            heights[place], order[place] = height, number
        # Gap sequence of Gonnet and Baeza-Yates: each gap is 5 / 11 of the previous one.
        gap = 1 if gap == 2 else (gap * 5 - 1) // 11


@dataclass(frozen=True)
class Clusters:
    """Clusters of a scan, sorted by cell, and by descending height within a cell.

    Attributes:
        points: the points on the map.
        threshold: largest height difference that `agree` accepts [standard deviations].
        relief: height difference up to which `agree` always accepts a cluster [m].
        groups: (q,) index of each cluster's cell in `points.cells`.
        firsts: (q,) index in `points` of each cluster's highest point.
        counts: (q,) number of points in each cluster.
        means: (q,) mean heights, weighted by inverse variance [m].
        variances: (q,) variances of the means [m^2], including pose uncertainty and scatter.
        spreads: (q,) amount by which the sample variance exceeds the point variances [m^2].
    """

    points: Sorted
    threshold: float
    relief: float
    groups: Integers
    firsts: Integers
    counts: Integers
    means: Numbers
    variances: Numbers
    spreads: Numbers

    def lowered(self, offset: float) -> Clusters:
        """Return a copy of the clusters, lowered by `offset` [m]."""
        points = replace(self.points, heights=self.points.heights - offset)
        return replace(self, points=points, means=self.means - offset)

    def agree(self, heights: Numbers, variances: Numbers) -> Mask:
        """Return a mask (q,) of the clusters that agree with the height of their cell.

        A cluster agrees if its mean differs from the height by at most
        `max(threshold * sqrt(height variance + cluster variance + spread), relief)`.
        `heights` and `variances` (m,) are those of the cells with points; unknown values are NaN.
        """
        gate = self.threshold * np.sqrt(variances[self.groups] + self.variances + self.spreads)
        away = np.abs(self.means - heights[self.groups])
        return away <= np.maximum(gate, self.relief)

    def first(self, chosen: Mask) -> Integers:
        """Return the index (m,) of each cell's highest cluster in the mask `chosen`, or `NONE`."""
        return self.last(chosen, -1)

    def last(self, chosen: Mask, step: int = 1) -> Integers:
        """Return the index (m,) of each cell's lowest cluster in the mask `chosen`, or `NONE`."""
        found = np.full(len(self.points.cells), NONE)
        numbers = np.flatnonzero(chosen)[::step]
        found[self.groups[numbers]] = numbers
        return found

    def members(self, numbers: Integers) -> tuple[Integers, Integers]:
        """Return the point indices of k clusters, and the offset (k,) of each cluster in them."""
        counts = self.counts[numbers]
        begins = np.cumsum(counts) - counts
        return np.repeat(self.firsts[numbers] - begins, counts) + np.arange(counts.sum()), begins


def clusters_of(points: Sorted, common: Numbers, resolution: float, given: Parameters) -> Clusters:
    """Group the points of each cell into clusters of consistent heights.

    `common` (m,) is the height variance [m^2] due to pose uncertainty.
    """
    threshold, relief = given.mahalanobis_distance_threshold, RELIEF * resolution
    z, r = points.heights, points.variances
    counts, sums = np.zeros(len(z), np.int64), np.zeros((3, len(z)))
    if run := grow_clusters.compiled():
        borders = points.begins, points.ends
        run(borders, len(points.cells), (z, r), (threshold, relief), counts, (*sums,))
    else:
        _grow_arrays(points, threshold, relief, counts, sums)
    firsts = np.flatnonzero(counts)
    counts, (weights, lifts, squares) = counts[firsts], sums[:, firsts]
    offsets = lifts / weights
    # Ratio of the sample variance to the expected variance; about 1 if the points are only noisy.
    others = np.maximum(counts - 1, 1)
    ratio = np.maximum(squares - lifts * offsets, 0.0) / others
    is_wide = ratio > 1.0 + threshold * np.sqrt(2.0 / others)
    excess = np.where(is_wide, ratio - 1.0, 0.0) / weights
    groups = np.searchsorted(points.begins, firsts, side="right") - 1
    # The excess is limited, so that relief alone never raises the variance above `max_variance`.
    variances = (1.0 / weights + np.minimum(excess, given.largest_share)) + common[groups]
    means = z[firsts] + offsets
    return Clusters(
        points, threshold, relief, groups, firsts, counts, means, variances, excess * counts
    )


def _grow_arrays(
    points: Sorted, threshold: float, relief: float, counts: Integers, sums: Numbers
) -> None:
    """NumPy version of `grow_clusters`, vectorized over cells."""
    z, r = points.heights, points.variances
    starts, stops = points.begins, points.ends
    while len(starts):
        lengths = stops - starts
        heads = np.cumsum(lengths) - lengths
        places = np.arange(lengths.sum()) + np.repeat(starts - heads, lengths)
        offsets = z[places] - np.repeat(z[starts], lengths)
        weights = 1.0 / r[places]
        # For each point, the sums over the higher points in its cell.
        above = [np.cumsum(part) - part for part in (weights, weights * offsets)]
        weight, lift = (part - np.repeat(part[heads], lengths) for part in above)
        weight[heads] = 1.0
        gate = np.maximum(threshold * np.sqrt(1.0 / weight + r[places]), relief)
        fails = ~(np.abs(offsets - lift / weight) <= gate)
        fails[heads] = False
        first = np.where(fails, np.arange(len(places)), len(places))
        sizes = np.minimum(np.minimum.reduceat(first, heads) - heads, lengths)
        counts[starts] = sizes
        inside = np.arange(len(places)) < np.repeat(heads + sizes, lengths)
        for row, part in zip(sums, (weights, weights * offsets, weights * offsets**2), strict=True):
            row[starts] = np.add.reduceat(np.where(inside, part, 0.0), heads)
        left = sizes < lengths
        starts, stops = (starts + sizes)[left], stops[left]


@loop(("int64*", 2), "int64", ("float64*", 2), ("float64", 2), "int64*", ("float64*", 3))
def grow_clusters(borders: Any, count: Any, points: Any, gate: Any, counts: Any, sums: Any) -> None:
    """Write the `counts` and `sums` of each cluster at the index of its first point.

    `sums` are the sums of w, w h and w h^2 over the points, where w is the inverse variance of a
    point, and h is its height above the first point.
    """
    begins, ends = borders
    z, r = points
    threshold, relief = gate
    weights, lifts, squares = sums
    for k in range(count):
        first = begins[k]
        for i in range(begins[k], ends[k]):
            offset, weight = z[i] - z[first], 1.0 / r[i]
            if i > first:
                away = abs(offset - lifts[first] / weights[first])
                limit = threshold * np.sqrt(1.0 / weights[first] + r[i])
                if not away <= max(limit, relief):
                    first, offset = i, 0.0
            counts[first] += 1
            weights[first] += weight
            lifts[first] += weight * offset
            squares[first] += weight * (offset * offset)
