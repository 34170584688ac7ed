# SPDX-License-Identifier: BSD-3-Clause
"""Clusters of the points of a scan: points of one cell that agree with each other.

From the highest point of a cell down, a point of height z and variance r joins the cluster above it
if `|z - mean| <= max(threshold * sqrt(variance of the mean + r), relief)`; else it starts another
one. The relief is the height by which a slope spreads the points of a cell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._arrays._checks import Integers, Mask
from .._loops import loop
from ._order import Sorted
from ._parameters import Parameters
from ._sensors import Numbers

RELIEF = 0.4
"""Difference of heights, in sides of a cell, that a slope within a cell explains."""

NONE = -1
"""In place of the number of a cluster."""


@dataclass(frozen=True)
class Clusters:
    """The clusters of a scan, cell by cell, and those of a cell from the highest down.

    Attributes:
        points: the points on the map.
        threshold, relief: of the gate; see `agree`.
        groups: (q,) place of the cell of each cluster in `points.cells`.
        firsts, counts: (q,) place of the highest point in `points`, and number of points.
        means: (q,) heights, weighted by inverse variances [m].
        variances: (q,) of the means [m^2]. They are larger if the points spread by more than their
            variances explain, and include the variance that all points of a cell share.
        spreads: (q,) the rest of the sample variance of these points [m^2], which widens the gate.
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
        """Return the clusters, lower by an offset [m]."""
        points = replace(self.points, heights=self.points.heights - offset)
        return replace(self, points=points, means=self.means - offset)

    def agree(self, heights: Numbers, variances: Numbers) -> Mask:
        """Return which clusters (q,) agree with a height of their cell, the gate.

        They differ by at most `threshold * sqrt(sum of variances and spread)`, or by the relief.

        Args:
            heights, variances: (m,) of the cells with points; a height is NaN if unknown.
        """
        gate = self.threshold * np.sqrt(variances[self.groups] + self.variances + self.spreads)
        away = np.abs(self.means - heights[self.groups])
        fits: Mask = away <= np.maximum(gate, self.relief)
        return fits

    def first(self, chosen: Mask) -> Integers:
        """Return the highest of the chosen clusters (q,) in each cell (m,), or `NONE`."""
        return self.last(chosen, -1)

    def last(self, chosen: Mask, step: int = 1) -> Integers:
        """Return the lowest of the chosen clusters (q,) in each cell (m,), or `NONE`."""
        found = np.full(len(self.points.cells), NONE)
        numbers = np.flatnonzero(chosen)[::step]
        found[self.groups[numbers]] = numbers
        return found

    def members(self, numbers: Integers) -> tuple[Integers, Integers]:
        """Return the places of the points of some clusters (k,), and where each cluster begins."""
        counts = self.counts[numbers]
        begins = np.cumsum(counts) - counts
        return np.repeat(self.firsts[numbers] - begins, counts) + np.arange(counts.sum()), begins


def clusters_of(points: Sorted, common: Numbers, resolution: float, given: Parameters) -> Clusters:
    """Return the clusters of the points on the map.

    `common` (m,) is the variance that all points of a cell share [m^2], such as that of the pose.
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
    # The sample variance in units of the mean variance of the points: 1 by their noise alone.
    others = np.maximum(counts - 1, 1)
    ratio = np.maximum(squares - lifts * offsets, 0.0) / others
    is_wide = ratio > 1.0 + threshold * np.sqrt(2.0 / others)
    excess = np.where(is_wide, ratio - 1.0, 0.0) / weights
    groups = np.searchsorted(points.begins, firsts, side="right") - 1
    # Relief alone makes no cell unknown.
    variances = (1.0 / weights + np.minimum(excess, given.largest_share)) + common[groups]
    means = z[firsts] + offsets
    return Clusters(
        points, threshold, relief, groups, firsts, counts, means, variances, excess * counts
    )


def _grow_arrays(
    points: Sorted, threshold: float, relief: float, counts: Integers, sums: Numbers
) -> None:
    """Do what `grow_clusters` does, with NumPy: the next cluster of all cells at a time."""
    z, r = points.heights, points.variances
    starts, stops = points.begins, points.ends
    while len(starts):
        lengths = stops - starts
        heads = np.cumsum(lengths) - lengths
        places = np.arange(lengths.sum()) + np.repeat(starts - heads, lengths)
        offsets = z[places] - np.repeat(z[starts], lengths)
        weights = 1.0 / r[places]
        # Sums over the points of the same cell above each point.
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
    """Write the size and the sums of each cluster at the place of its first point.

    The sums are those of weights, of weighted offsets from the first point, and of their squares.
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
