# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Fusion of the points of a scan with the heights of their cells.

The scan alone decides which of its points are the surface of a cell: the highest cluster with
support, that is at least `conflict_points` points, and `min_support` of the points of the densest
cluster in the cell. A cluster agrees with a height if they differ by at most
`threshold * sqrt(sum of their variances)`, or by the relief. A cell becomes

- `CONFIRMED`: its height agrees with the surface, or with a smaller cluster above it. Both are
  fused by inverse variances.
- `STARTED`: it was unknown. It takes the surface, or its highest cluster if none has support.
- `RAISED`: the surface is higher; or a smaller cluster of at least `conflict_points` points above
  the surface, a candidate, was seen at the same height in three scans within half a second.
- `LOWERED`: the surface is lower, and the height was not confirmed for `scanning_duration`, or at
  most `conflict_points` points ever supported it. In the first case only points count whose beams
  entered the cell above its height: they came through the old surface.
- `CONTRADICTED`: none of these; the height stays.

`RAISED`, `LOWERED` and `CONTRADICTED` are conflicts, which add `multi_height_noise`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ..arrays._checks import Integers, Mask
from ..map._geometry import GridGeometry
from ._clusters import NONE, Clusters
from ._neighbors import highest_around
from ._parameters import Parameters
from ._sensors import Numbers
from ._state import OVERHANG, State

SIGHTINGS = 3
"""Number of scans in which a candidate is seen before it becomes the surface."""

TAIL = 0.1
"""Share of the points of a neighbor below which a cell has only the tails of their noise."""

CANDIDATE_TIME = 500
"""Time within which these scans come [ms]."""


class Outcome(IntEnum):
    """What became of a cell with points."""

    STARTED = 0
    CONFIRMED = 1
    RAISED = 2
    LOWERED = 3
    CONTRADICTED = 4


@dataclass(frozen=True)
class Fused:
    """Result of the fusion.

    Attributes:
        outcomes: (m,) an `Outcome` for each cell with points.
        used: (n,) whether a point is part of the height of its cell now.
    """

    outcomes: NDArray[np.int64]
    used: Mask


def fuse(
    clusters: Clusters,
    state: State,
    geometry: GridGeometry,
    entries: Callable[[Integers], Numbers],
    given: Parameters,
) -> Fused:
    """Fuse the clusters of a scan into the cells of a map, in place.

    Args:
        clusters: the clusters of the scan.
        state: the map.
        geometry: geometry of the map.
        entries: returns the heights [m] at which the beams of some points entered their cells.
        given: parameters.
    """
    cells = clusters.points.cells
    solid = clusters.counts >= given.conflict_points
    is_low = np.ones(len(solid), np.bool_)
    if given.overhang_clearance > 0.0:
        is_low = _under_overhangs(clusters, solid, state, given)
    counts = np.where(is_low, clusters.counts, 0)
    densest = np.maximum.reduceat(counts, clusters.heads)[clusters.groups]
    surface = clusters.first(solid & is_low & (counts >= given.min_support * densest))
    chosen = np.where(surface == NONE, clusters.first(is_low), surface)
    solid &= is_low
    outcomes, chosen = _decided(clusters, solid, surface, chosen, state, geometry, entries, given)

    old, before = state.heights[cells], state.variances[cells]
    means, new = clusters.means[chosen], clusters.variances[chosen]
    rise, merged = means - old, before * new / (before + new)
    # If a scan and a map disagree within the relief, both are less certain than they claim.
    doubt = np.maximum((rise / clusters.threshold) ** 2 / (before + new), 1.0)
    stays, fits = outcomes == Outcome.CONTRADICTED, outcomes == Outcome.CONFIRMED
    heights = np.where(fits, old + rise * merged / new, np.where(stays, old, means))
    variances = np.where(fits, doubt * merged, np.where(stays, before, new))
    support = np.where(stays, 0, clusters.counts[chosen])
    support = support + np.where(stays | fits, state.memory.support[cells], 0.0)

    found = _seen_again(clusters, solid, chosen, heights, variances, state)
    grown = np.flatnonzero(found != NONE)
    outcomes[grown], chosen[grown] = Outcome.RAISED, found[grown]
    heights[grown] = clusters.means[chosen[grown]]
    variances[grown] = clusters.variances[chosen[grown]]
    support[grown] = SIGHTINGS * clusters.counts[chosen[grown]]

    state.heights[cells], state.memory.support[cells] = heights, support
    is_seen = outcomes != Outcome.CONTRADICTED
    least = np.minimum(_least_variances(clusters, chosen, state, geometry), given.largest_share)
    variances = np.maximum(variances, np.where(is_seen, least, 0.0))
    variances = np.maximum(variances, given.min_variance)
    is_conflict = outcomes >= Outcome.RAISED
    state.variances[cells] = variances + given.multi_height_noise * is_conflict
    used = np.zeros(len(clusters.points.order), np.bool_)
    used[clusters.members(chosen[is_seen])[0]] = True
    return Fused(outcomes, used)


def _decided(
    clusters: Clusters,
    solid: Mask,
    surface: Integers,
    chosen: Integers,
    state: State,
    geometry: GridGeometry,
    entries: Callable[[Integers], Numbers],
    given: Parameters,
) -> tuple[NDArray[np.int64], Integers]:
    """Return what becomes of the cells (m,), candidates left aside, and by which clusters."""
    cells, groups = clusters.points.cells, clusters.groups
    old = state.heights[cells]
    agrees = clusters.agree(old, state.variances[cells])
    smaller = solid & (np.arange(len(groups)) < surface[groups])
    confirming = clusters.first(agrees & (smaller | (surface == NONE)[groups]))
    confirming = np.where(agrees[chosen], chosen, confirming)
    is_confirmed = confirming != NONE
    chosen = np.where(is_confirmed, confirming, chosen)
    rise = clusters.means[chosen] - old
    outcomes = np.full(len(cells), int(Outcome.CONTRADICTED))
    outcomes[(surface != NONE) & (rise > 0.0)] = Outcome.RAISED
    lower = np.flatnonzero((rise < 0.0) & ~is_confirmed)
    is_supported = (surface != NONE)[lower]
    gives = _gives_way(clusters, chosen[lower], is_supported, state, geometry, entries, given)
    outcomes[lower[gives]] = Outcome.LOWERED
    outcomes[is_confirmed] = Outcome.CONFIRMED
    outcomes[np.isnan(old)] = Outcome.STARTED
    return outcomes, chosen


def _least_variances(
    clusters: Clusters, chosen: Integers, state: State, geometry: GridGeometry
) -> Numbers:
    """Return the smallest variances (m,) that heights can reach [m^2].

    Points come down anywhere in a cell. If u is the largest difference of heights to a neighbor, at
    most the side of a cell, the mean of n points varies by u^2 / 12 n around the height of the
    center. In a cell with few points beside one with many, there is only outlying noise of the
    neighbor's points, which does not average out.
    """
    cells, size = clusters.points.cells, geometry.size
    support, heights = state.memory.support[cells], state.heights[cells].astype(np.float32)
    rise = highest_around(state.heights, size)[cells] - heights
    fall = heights + highest_around(-state.heights, size)[cells]
    slope = np.minimum(np.maximum(rise, fall), geometry.resolution).astype(np.float64)
    is_tail = support < TAIL * highest_around(state.memory.support, size)[cells]
    tails = 4.0 * clusters.points.variances[clusters.firsts[chosen]]
    least: Numbers = np.maximum(slope * slope / (12.0 * support), is_tail * tails)
    return least


def _gives_way(
    clusters: Clusters,
    chosen: Integers,
    is_supported: Mask,
    state: State,
    geometry: GridGeometry,
    entries: Callable[[Integers], Numbers],
    given: Parameters,
) -> Mask:
    """Return whether heights give way to clusters (k,) below them, which may have support (k,)."""
    cells = clusters.points.cells[clusters.groups[chosen]]
    # A neighbor that stands tells of an obstacle of which the cell has only a part.
    beside = highest_around(state.heights, geometry.size, itself=False)[cells]
    alone = beside <= clusters.means[chosen] + geometry.resolution
    gives = alone & (state.memory.support[cells] <= given.conflict_points)
    unsure = np.flatnonzero(state.is_stale(given)[cells] & ~gives & is_supported)
    if len(unsure):
        places, begins = clusters.members(chosen[unsure])
        limits = np.repeat(state.heights[cells[unsure]], clusters.counts[chosen[unsure]])
        through = np.add.reduceat(entries(places) >= limits, begins, dtype=np.int64)
        gives[unsure] = through >= given.conflict_points
    return gives


def _seen_again(
    clusters: Clusters,
    solid: Mask,
    chosen: Integers,
    heights: Numbers,
    variances: Numbers,
    state: State,
) -> Integers:
    """Return the candidates (m,) that were seen in enough scans, or `NONE`; note the others.

    Args:
        clusters: the clusters of the scan.
        solid: (q,) which of them have enough points.
        chosen: (m,) the clusters below the candidates.
        heights, variances: (m,) of the cells.
        state: the map.
    """
    cells, groups, means = clusters.points.cells, clusters.groups, clusters.means
    candidates = solid & (np.arange(len(groups)) < chosen[groups]) & (means > heights[groups])
    candidates &= ~clusters.agree(heights, variances)
    height, sightings = state.memory.candidate, state.memory.sightings
    age = state.memory.candidate_age
    waits = (age[cells] <= CANDIDATE_TIME)[groups]
    gate = np.maximum(clusters.threshold * np.sqrt(2.0 * clusters.variances), clusters.relief)
    again = clusters.first(candidates & waits & (np.abs(means - height[cells][groups]) <= gate))
    # One that was seen only once makes room.
    waits &= ((again != NONE) | (sightings[cells] > 1.0))[groups]
    new = clusters.first(candidates & ~waits)
    sightings[cells] = np.where(new != NONE, 1.0, sightings[cells] + (again != NONE))
    age[cells[new != NONE]] = 0.0
    seen = np.where(again != NONE, again, new)
    height[cells] = np.where(seen != NONE, means[seen], height[cells])
    done = (again != NONE) & (sightings[cells] >= SIGHTINGS)
    age[cells[done]] = np.nan
    return np.where(done, again, NONE)


def _under_overhangs(clusters: Clusters, solid: Mask, state: State, given: Parameters) -> Mask:
    """Return the clusters (q,) that are not above a gap over ground; note the gaps in the map.

    A height that turns out to be that of an overhang is forgotten.

    Args:
        clusters: the clusters of the scan.
        solid: (q,) which of them have enough points to bound a gap.
        state: the map, whose layer `overhang` gets the lower sides.
        given: parameters.
    """
    cells, groups, numbers = clusters.points.cells, clusters.groups, np.flatnonzero(solid)
    tops = clusters.points.heights[clusters.firsts]
    bottoms = clusters.points.heights[clusters.firsts + clusters.counts - 1]
    above, under = numbers[:-1], numbers[1:]
    gaps = (bottoms[above] - tops[under] > given.overhang_clearance) & (
        groups[above] == groups[under]
    )
    is_roof = np.zeros(len(groups), np.bool_)
    is_roof[above[gaps]] = True
    roof = clusters.last(is_roof)
    is_low = np.arange(len(groups)) > roof[groups]
    nothing = np.full(len(state.heights), np.nan, np.float32)
    layer, age = state.others.setdefault(OVERHANG, nothing), state.memory.overhang_age
    seen = roof != NONE
    layer[cells[~seen & (age[cells] >= 1e3 * given.scanning_duration)]] = np.nan
    layer[cells[seen]], age[cells[seen]] = bottoms[roof[seen]], 0.0
    known = clusters.agree(state.heights[cells], state.variances[cells])
    state.heights[cells[clusters.first(known & ~is_low) != NONE]] = np.nan
    return is_low
