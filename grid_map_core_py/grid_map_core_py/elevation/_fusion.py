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
from ._clusters import NONE, RELIEF, Clusters
from ._parameters import Parameters
from ._sensors import Numbers
from ._state import HIDDEN, OVERHANG, State
from ._visibility import highest_around

SIGHTINGS = 3
"""Number of scans in which a candidate is seen before it becomes the surface."""

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

    @property
    def is_new(self) -> Mask:
        """(m,) whether the height of a cell with points started anew."""
        return np.isin(self.outcomes, (Outcome.STARTED, Outcome.RAISED, Outcome.LOWERED))


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
    cells, groups, means = clusters.points.cells, clusters.groups, clusters.means
    old, variance = state.heights[cells], state.variances[cells]
    t, relief = given.mahalanobis_distance_threshold, RELIEF * geometry.resolution

    def agrees(heights: Numbers, spreads: Numbers) -> Mask:
        gate = np.maximum(t * np.sqrt(spreads[groups] + clusters.variances), relief)
        return np.abs(means - heights[groups]) <= gate

    solid = clusters.counts >= given.conflict_points
    densest = np.maximum.reduceat(clusters.counts, clusters.heads)
    supported = solid & (clusters.counts >= given.min_support * densest[groups])
    if given.overhang_clearance > 0.0:
        is_low = _under_overhangs(clusters, solid, supported, state, given)
        solid, supported = solid & is_low, supported & is_low
    surface = clusters.first(supported)
    chosen = np.where(surface == NONE, clusters.heads, surface)
    same = agrees(old, variance)
    smaller = solid & (np.arange(len(groups)) < surface[groups])
    confirming = clusters.first(same & (smaller | (surface == NONE)[groups]))
    confirming = np.where(same[chosen], chosen, confirming)
    is_confirmed = confirming != NONE
    chosen = np.where(is_confirmed, confirming, chosen)

    rise = means[chosen] - old
    outcomes = np.full(len(cells), int(Outcome.CONTRADICTED))
    outcomes[(surface != NONE) & (rise > 0.0)] = Outcome.RAISED
    lower = np.flatnonzero((rise < 0.0) & ~is_confirmed)
    gives = _gives_way(clusters, chosen[lower], supported, state, geometry, entries, given)
    outcomes[lower[gives]] = Outcome.LOWERED
    outcomes[is_confirmed] = Outcome.CONFIRMED
    outcomes[np.isnan(old)] = Outcome.STARTED

    # If a scan and a map disagree within the relief, both are less certain than they claim.
    new = clusters.variances[chosen]
    doubt = np.maximum(rise * rise / (t * t * (variance + new)), 1.0)
    merged = variance * new / (variance + new)
    is_new, fits = outcomes != Outcome.CONTRADICTED, outcomes == Outcome.CONFIRMED
    heights = np.where(fits, old + rise * merged / new, np.where(is_new, means[chosen], old))
    variance = np.where(fits, doubt * merged, np.where(is_new, new, variance))
    gained = np.where(is_new, clusters.counts[chosen], 0)

    higher = solid & (np.arange(len(groups)) < chosen[groups]) & (means > heights[groups])
    found = _seen_again(clusters, higher & ~agrees(heights, variance), state, t, relief)
    grown = found != NONE
    outcomes[grown], chosen[grown] = Outcome.RAISED, found[grown]
    heights[grown], variance[grown] = means[found[grown]], clusters.variances[found[grown]]
    gained[grown] = SIGHTINGS * clusters.counts[found[grown]]

    variance = np.maximum(variance, given.min_variance)
    variance += np.where(outcomes >= Outcome.RAISED, given.multi_height_noise, 0.0)
    state.heights[cells], state.variances[cells] = heights, variance
    keeps = (outcomes == Outcome.CONFIRMED) | (outcomes == Outcome.CONTRADICTED)
    state.support[cells] = gained + np.where(keeps, state.support[cells], 0.0)
    used = np.zeros(len(clusters.points.order), np.bool_)
    used[clusters.members(chosen[outcomes != Outcome.CONTRADICTED])[0]] = True
    return Fused(outcomes, used)


def _gives_way(
    clusters: Clusters,
    chosen: Integers,
    supported: Mask,
    state: State,
    geometry: GridGeometry,
    entries: Callable[[Integers], Numbers],
    given: Parameters,
) -> Mask:
    """Return whether the heights of cells give way to clusters (k,) below them."""
    cells = clusters.points.cells[clusters.groups[chosen]]
    # A neighbor that stands tells of an obstacle of which the cell has only a part.
    beside = highest_around(state.heights, cells, geometry.size, itself=False)
    alone = beside <= clusters.means[chosen] + geometry.resolution
    gives = alone & (state.support[cells] <= given.conflict_points)
    stale = state.ages[cells] >= 1e3 * given.scanning_duration
    unsure = np.flatnonzero(stale & ~gives & supported[chosen])
    if len(unsure):
        places, begins = clusters.members(chosen[unsure])
        limits = np.repeat(state.heights[cells[unsure]], clusters.counts[chosen[unsure]])
        through = np.add.reduceat(entries(places) >= limits, begins, dtype=np.int64)
        gives[unsure] = through >= given.conflict_points
    return gives


def _seen_again(
    clusters: Clusters, candidates: Mask, state: State, threshold: float, relief: float
) -> Integers:
    """Return the candidates (m,) that were seen in enough scans, or `NONE`; note the others.

    Args:
        clusters: the clusters of the scan.
        candidates: (q,) which of them are candidates.
        state: the map.
        threshold, relief: of the gate between two sightings.
    """
    cells, groups, means = clusters.points.cells, clusters.groups, clusters.means
    gate = np.maximum(threshold * np.sqrt(2.0 * clusters.variances), relief)
    height, sightings, age = (state.hidden[name] for name in HIDDEN[2:5])
    waits = (age[cells] <= CANDIDATE_TIME)[groups]
    again = clusters.first(candidates & waits & (np.abs(means - height[cells][groups]) <= gate))
    new = clusters.first(candidates & ~waits)
    sightings[cells] = np.where(new != NONE, 1.0, sightings[cells] + (again != NONE))
    age[cells[new != NONE]] = 0.0
    seen = np.where(again != NONE, again, new)
    height[cells] = np.where(seen != NONE, means[seen], height[cells])
    done = (again != NONE) & (sightings[cells] >= SIGHTINGS)
    age[cells[done]] = np.nan
    return np.where(done, again, NONE)


def _under_overhangs(
    clusters: Clusters, solid: Mask, supported: Mask, state: State, given: Parameters
) -> Mask:
    """Return the clusters (q,) that are not above a gap over supported ground; note the gaps.

    Args:
        clusters: the clusters of the scan.
        solid, supported: (q,) which of them have enough points to bound a gap, or to be ground.
        state: the map, whose layer `overhang` gets the lower sides.
        given: parameters.
    """
    groups, numbers = clusters.groups, np.flatnonzero(solid)
    tops = clusters.points.heights[clusters.firsts]
    ground = clusters.last(supported)[groups]
    above, under = numbers[:-1], numbers[1:]
    gaps = (clusters.bottoms[above] - tops[under] > given.overhang_clearance) & (
        under <= ground[above]
    )
    is_roof = np.zeros(len(groups), np.bool_)
    is_roof[above[gaps]] = True
    roof, cells = clusters.last(is_roof), clusters.points.cells
    nothing = np.full(len(state.heights), np.nan, np.float32)
    layer, age = state.others.setdefault(OVERHANG, nothing), state.hidden[HIDDEN[5]]
    seen = roof != NONE
    layer[cells[~seen & (age[cells] >= 1e3 * given.scanning_duration)]] = np.nan
    layer[cells[seen]], age[cells[seen]] = clusters.bottoms[roof[seen]], 0.0
    return np.arange(len(groups)) > roof[groups]
