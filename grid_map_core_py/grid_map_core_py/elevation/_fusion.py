# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Fusion of the points of a scan with the heights of their cells.

A point of height z and variance r agrees with a height h of variance v if
`|z - h| <= threshold * sqrt(v + r)` (the gate). Each cell with points gets one of these states:

- `CONFIRMED`: points agree with the height. They are fused by inverse variances, all at once.
- `STARTED`: the cell was unknown. It takes its highest cluster: points, from the highest down, join
  the mean of those above them while they agree with it.
- `RAISED`: no point agrees, and the highest cluster of at least `conflict_points` points above the
  gate becomes the height.
- `LOWERED`: the same below the gate, in cells that were not confirmed for `scanning_duration`. Only
  points count whose beams entered the cell above its height: they came through the old surface.
- `CONTRADICTED`: no point agrees, and the height stays.

`RAISED`, `LOWERED` and `CONTRADICTED` are conflicts, which add `multi_height_noise`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays._checks import Integers, Mask
from ..loops import loop
from ._order import Sorted
from ._sensors import Numbers

CONFIRMED, STARTED, RAISED, LOWERED, CONTRADICTED = range(1, 6)

_FEW = 32
"""Points of a cluster that NumPy adds up for all cells at once."""


@dataclass(frozen=True)
class Rules:
    """Numbers of the fusion, as in `Parameters`."""

    threshold: float
    min_variance: float
    multi_height_noise: float
    conflict_points: int


def fuse(
    points: Sorted,
    entries: Numbers,
    heights: Numbers,
    variances: Numbers,
    stale: Mask,
    rules: Rules,
) -> tuple[NDArray[np.uint8], Mask]:
    """Fuse points into the cells of a map, in place.

    Args:
        points: the points on the map.
        entries: (n,) height at which the beam of each point entered its cell [m]; -inf if it does
            not matter. In the order of `points`.
        heights, variances: (cells,) of all cells; a height is NaN where it is unknown.
        stale: (cells,) whether a cell was not confirmed for `scanning_duration`.
        rules: numbers of the fusion.

    Returns:
        states: (m,) state of each cell with points.
        used: (n,) whether a point is part of the height of its cell now.
    """
    states = np.zeros(len(points.cells), np.uint8)
    used = np.zeros(len(points.heights), np.uint8)
    numbers = rules.threshold, rules.min_variance, rules.multi_height_noise
    run = fuse_cells.compiled()
    if run:
        run(
            points.cells,
            points.begins,
            points.ends,
            len(points.cells),
            points.heights,
            points.variances,
            entries,
            heights,
            variances,
            stale.view(np.uint8),
            numbers,
            rules.conflict_points,
            states,
            used,
        )
        return states, used.view(np.bool_)
    _fuse_arrays(points, entries, heights, variances, stale, rules, states, used.view(np.bool_))
    return states, used.view(np.bool_)


def _fuse_arrays(
    points: Sorted,
    entries: Numbers,
    heights: Numbers,
    variances: Numbers,
    stale: Mask,
    rules: Rules,
    states: NDArray[np.uint8],
    used: Mask,
) -> None:
    """Do what `fuse_cells` does, with NumPy."""
    cells, groups = points.cells, points.groups
    count = len(cells)
    old, variance = heights[cells], variances[cells]
    known = ~np.isnan(old)
    z, r = points.heights, points.variances
    away = np.abs(z - old[groups])
    agrees = away <= rules.threshold * np.sqrt(variance[groups] + r)
    used |= agrees
    confirmed = np.bincount(groups[agrees], minlength=count) > 0
    weights = 1.0 / r[agrees]
    weight = np.bincount(groups[agrees], weights, count)
    lift = np.bincount(groups[agrees], weights * (z[agrees] - old[groups[agrees]]), count)
    total = 1.0 / variance + weight
    new_heights = np.where(confirmed, old + lift / total, old)
    new_variances = np.where(confirmed, np.maximum(1.0 / total, rules.min_variance), variance)
    states[confirmed] = CONFIRMED
    open_points = ~confirmed[groups]
    above = open_points & (z > old[groups])
    below = open_points & stale[cells][groups] & (z < old[groups]) & (entries >= old[groups])
    for state, candidates, least in (
        (STARTED, ~known[groups], 1),
        (RAISED, above, rules.conflict_points),
        (LOWERED, below, rules.conflict_points),
    ):
        chosen = np.flatnonzero(candidates & (states == 0)[groups])
        found, members, mean, spread = _highest_clusters(
            groups[chosen], z[chosen], r[chosen], least, rules.threshold
        )
        states[found] = state
        used[chosen[members]] = True
        new_heights[found] = mean
        new_variances[found] = np.maximum(spread, rules.min_variance)
    states[states == 0] = CONTRADICTED
    new_variances[states >= RAISED] += rules.multi_height_noise
    heights[cells], variances[cells] = new_heights, new_variances


def _highest_clusters(
    groups: Integers, z: Numbers, r: Numbers, least: int, threshold: float
) -> tuple[Integers, Integers, Numbers, Numbers]:
    """Return the highest cluster of at least `least` points of each group that has one.

    Args:
        groups: (n,) ascending; z (n,) descending within a group; r (n,) their variances.
        least: smallest number of points.
        threshold: of the gate.

    Returns:
        The groups, the places of the points in the clusters, the means and their variances.
    """
    starts = np.flatnonzero(np.diff(groups, prepend=-1))
    stops = np.append(starts[1:], len(groups))
    found: list[Any] = []
    while len(starts):
        counts, weight, lift = _grown(z, r, starts, stops, threshold)
        enough = counts >= least
        for first, number, w, s in zip(
            starts[enough], counts[enough], weight[enough], lift[enough], strict=True
        ):
            found.append((groups[first], first, number, z[first] + s / w, 1.0 / w))
        starts, stops = (starts + counts)[~enough], stops[~enough]
        left = starts < stops
        starts, stops = starts[left], stops[left]
    if not found:
        nothing = np.zeros(0, np.int64)
        return nothing, nothing, np.zeros(0), np.zeros(0)
    names, firsts, numbers, means, spreads = map(np.array, zip(*found, strict=True))
    members = np.repeat(firsts - np.cumsum(numbers) + numbers, numbers) + np.arange(numbers.sum())
    return names, members, means, spreads


def _grown(
    z: Numbers, r: Numbers, starts: Integers, stops: Integers, threshold: float
) -> tuple[Integers, Numbers, Numbers]:
    """Return the sizes of clusters that begin at `starts`, their weights and weighted offsets.

    Offsets are relative to the first point.
    """
    counts = np.ones(len(starts), np.int64)
    weight, lift = 1.0 / r[starts], np.zeros(len(starts))
    growing = np.flatnonzero(stops - starts > 1)
    while len(growing):
        if counts[growing[0]] >= _FEW:
            for group in growing.tolist():
                _grow_one(z, r, starts, stops, threshold, counts, weight, lift, group)
            break
        first = starts[growing]
        place = first + counts[growing]
        w, s, offset = weight[growing], lift[growing], z[place] - z[first]
        joins = np.abs(offset - s / w) <= threshold * np.sqrt(1.0 / w + r[place])
        growing, place, offset = growing[joins], place[joins], offset[joins]
        weight[growing] += 1.0 / r[place]
        lift[growing] += 1.0 / r[place] * offset
        counts[growing] += 1
        growing = growing[place + 1 < stops[growing]]
    return counts, weight, lift


def _grow_one(
    z: Numbers,
    r: Numbers,
    starts: Integers,
    stops: Integers,
    threshold: float,
    counts: Integers,
    weight: Numbers,
    lift: Numbers,
    group: int,
) -> None:
    """Grow one cluster as far as it goes; its points are added up in the same order."""
    part = slice(starts[group], stops[group])
    weights = 1.0 / r[part]
    offsets = z[part] - z[part.start]
    sums, lifts = np.cumsum(weights), np.cumsum(weights * offsets)
    away = np.abs(offsets[1:] - lifts[:-1] / sums[:-1])
    fails = away > threshold * np.sqrt(1.0 / sums[:-1] + r[part][1:])
    counts[group] = 1 + int(np.argmax(fails)) if fails.any() else len(weights)
    weight[group], lift[group] = sums[counts[group] - 1], lifts[counts[group] - 1]


def cluster_end(
    z: Any, r: Any, entries: Any, begin: Any, end: Any, entry: Any, threshold: Any
) -> Any:
    """Return the point behind a cluster that begins with the first point that counts.

    Returns:
        The place, the number of points, the mean, and its variance.
    """
    count, weight, lift, reference = 0, 0.0, 0.0, 0.0
    i = begin
    while i < end:
        if entries[i] >= entry:
            if count == 0:
                reference = z[i]
            else:
                away = abs(z[i] - reference - lift / weight)
                if not away <= threshold * np.sqrt(1.0 / weight + r[i]):
                    break
            weight += 1.0 / r[i]
            lift += 1.0 / r[i] * (z[i] - reference)
            count += 1
        i += 1
    return i, count, reference + lift / weight, 1.0 / weight


def agreeing(
    z: Any, r: Any, begin: Any, end: Any, height: Any, variance: Any, threshold: Any, used: Any
) -> Any:
    """Mark the points that agree with a height; return their number, weight and weighted offset."""
    count, weight, lift = 0, 0.0, 0.0
    for i in range(begin, end):
        if abs(z[i] - height) <= threshold * np.sqrt(variance + r[i]):
            weight += 1.0 / r[i]
            lift += 1.0 / r[i] * (z[i] - height)
            used[i] = 1
            count += 1
    return count, weight, lift


def highest(
    z: Any,
    r: Any,
    entries: Any,
    begin: Any,
    end: Any,
    entry: Any,
    threshold: Any,
    least: Any,
    used: Any,
) -> Any:
    """Mark the highest cluster of enough points; return their number or 0, mean and variance."""
    while begin < end:
        stop, count, mean, variance = cluster_end(z, r, entries, begin, end, entry, threshold)
        if count >= least:
            for i in range(begin, stop):
                if entries[i] >= entry:
                    used[i] = 1
            return count, mean, variance
        begin = stop
    return 0, 0.0, 0.0


def first_below(z: Any, begin: Any, end: Any, height: Any) -> Any:
    """Return the first point that is not above a height."""
    while begin < end and z[begin] > height:
        begin += 1
    return begin


@loop(
    "int64*",
    "int64*",
    "int64*",
    "int64",
    "float64*",
    "float64*",
    "float64*",
    "float64*",
    "float64*",
    "uint8*",
    ("float64", 3),
    "int64",
    "uint8*",
    "uint8*",
)
def fuse_cells(
    cells: Any,
    begins: Any,
    ends: Any,
    count: Any,
    z: Any,
    r: Any,
    entries: Any,
    heights: Any,
    variances: Any,
    stale: Any,
    numbers: Any,
    conflict_points: Any,
    states: Any,
    used: Any,
) -> None:
    """Fuse the points of each cell; see `fuse`."""
    threshold, least, noise = numbers
    for k in range(count):
        cell, begin, end = cells[k], begins[k], ends[k]
        height, variance = heights[cell], variances[cell]
        if height != height:
            _, mean, spread = highest(z, r, entries, begin, end, -np.inf, threshold, 1, used)
            heights[cell], variances[cell], states[k] = mean, max(spread, least), STARTED
            continue
        members, weight, lift = agreeing(z, r, begin, end, height, variance, threshold, used)
        if members > 0:
            total = 1.0 / variance + weight
            heights[cell], states[k] = height + lift / total, CONFIRMED
            variances[cell] = max(1.0 / total, least)
            continue
        split, state = first_below(z, begin, end, height), RAISED
        members, mean, spread = highest(
            z, r, entries, begin, split, -np.inf, threshold, conflict_points, used
        )
        if members == 0 and stale[cell] == 1:
            state = LOWERED
            members, mean, spread = highest(
                z, r, entries, split, end, height, threshold, conflict_points, used
            )
        if members > 0:
            heights[cell], variances[cell], states[k] = mean, max(spread, least) + noise, state
        else:
            variances[cell], states[k] = variance + noise, CONTRADICTED
