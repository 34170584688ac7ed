# SPDX-License-Identifier: BSD-3-Clause
"""Fuses the points of a scan with the heights of their cells.

`docs/elevation_model.md` explains the decisions. Each cell with points has one of these outcomes:

- `CONFIRMED`: the height agrees with the surface, or with a smaller cluster above the surface. The
  height and the cluster are fused with inverse-variance weights.
- `STARTED`: the height was unknown. The surface, or else the highest cluster, becomes the height.
- `RAISED`: the surface, or a confirmed candidate, is above the height and replaces it.
- `LOWERED`: the surface, or else the highest cluster, is below the height and replaces it.
- `CONTRADICTED`: none of the above applies. The height does not change.

With a steady drift, drift compensation makes the map lag behind the odometry by
`drift per scan / drift_compensation_alpha`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Integers, Mask, Size
from ..map._geometry import GridGeometry
from ._clusters import NONE, Clusters
from ._parameters import Numbers, Parameters
from ._state import OVERHANG, State, highest_around

SIGHTINGS = 3
"""Number of scans that must contain a candidate before the candidate becomes the surface."""

TAIL = 0.1
"""If a cell has less than this share of a neighbor's support, its points may be mere noise."""

CANDIDATE_TIME = 500
"""Maximum time between the first and the last sighting of a candidate [ms]."""

LEVEL = 0.03
"""Largest height difference [m] between a cell that votes on the drift and its eight neighbors."""


def drift(clusters: Clusters, state: State, size: Size, given: Parameters) -> float:
    """Return the vertical offset of a scan from the map [m], or 0 if it is uncertain.

    `docs/elevation_model.md` explains the votes of the cells. The tolerance of a vote is
    `threshold * sqrt(height variance + cluster variance)`. Votes that exceed `max_drift` by more
    than their tolerance are ignored.
    """
    heights, variances = state.heights, state.variances
    cells, threshold = clusters.points.cells[clusters.groups], given.mahalanobis_distance_threshold
    away, spread = clusters.means - heights[cells], variances[cells] + clusters.variances
    votes = np.abs(away) <= given.max_drift + threshold * np.sqrt(spread)
    votes &= variances[cells] <= given.drift_compensation_variance_inlier
    unknown = np.isnan(heights)
    highest = highest_around(np.where(unknown, np.inf, heights), size)
    lowest = -highest_around(np.where(unknown, np.inf, -heights), size)
    with np.errstate(invalid="ignore"):
        level = np.maximum(highest - heights, heights - lowest) <= LEVEL
    grid = level.reshape(size[::-1])
    grid[[0, -1]] = grid[:, [0, -1]] = False
    votes[votes] = level[cells[votes]]
    away, spread = away[votes], spread[votes]
    if len(away) < given.min_drift_cells:
        return 0.0
    agrees = np.abs(away - np.median(away)) <= threshold * np.sqrt(spread)
    if agrees.sum() < max(given.min_drift_cells, 0.5 * len(away)):
        return 0.0
    mean = float(np.average(away[agrees], weights=1.0 / spread[agrees]))
    return mean if abs(mean) <= given.max_drift else 0.0


class Outcome(IntEnum):
    """Outcome of the fusion in a cell with points; see the module docstring."""

    STARTED = 0
    CONFIRMED = 1
    RAISED = 2
    LOWERED = 3
    CONTRADICTED = 4


@dataclass
class Fusion:
    """Fusion of the clusters of a scan into the map state, which is modified in place.

    Attributes:
        entries: returns the heights [m] at which the beams of given points entered their cells.
        outcomes: (m,) `Outcome` of each cell with points.
        chosen: (m,) index of the cluster that determined each outcome.
    """

    clusters: Clusters
    state: State
    geometry: GridGeometry
    entries: Callable[[Integers], Numbers]
    given: Parameters
    outcomes: NDArray[np.int64] = field(init=False)
    chosen: Integers = field(init=False)

    def __post_init__(self) -> None:
        clusters, given = self.clusters, self.given
        self._cells, self._numbers = clusters.points.cells, np.arange(len(clusters.groups))
        is_large = clusters.counts >= given.conflict_points
        is_low = np.ones(len(is_large), np.bool_)
        if given.overhang_clearance > 0.0:
            is_low = self._numbers > self._overhangs(is_large)[clusters.groups]
        counts = np.where(is_low, clusters.counts, 0)
        heads = np.searchsorted(clusters.groups, np.arange(len(self._cells)))
        densest = np.maximum.reduceat(counts, heads)[clusters.groups]
        surface = clusters.first(is_large & is_low & (counts >= given.min_support * densest))
        self.chosen = np.where(surface == NONE, clusters.first(is_low), surface)
        self._decide(surface, is_large & is_low)
        self._merge(is_large & is_low)

    @property
    def is_seen(self) -> Mask:
        """(m,) mask of the cells whose height this scan has set or confirmed."""
        return np.asarray(self.outcomes != Outcome.CONTRADICTED)

    @property
    def used(self) -> Mask:
        """(n,) mask of the points that were fused into the height of their cell."""
        used = np.zeros(len(self.clusters.points.order), np.bool_)
        used[self.clusters.members(self.chosen[self.is_seen])[0]] = True
        return used

    def _decide(self, surface: Integers, is_large: Mask) -> None:
        """Set `outcomes` and `chosen`; `_merge` later changes them for accepted candidates."""
        clusters, groups, old = self.clusters, self.clusters.groups, self.state.heights[self._cells]
        agrees = clusters.agree(old, self.state.variances[self._cells])
        smaller = is_large & (self._numbers < surface[groups])
        confirming = clusters.first(agrees & (smaller | (surface == NONE)[groups]))
        confirming = np.where(agrees[self.chosen], self.chosen, confirming)
        is_confirmed = confirming != NONE
        self.chosen = np.where(is_confirmed, confirming, self.chosen)
        rise = clusters.means[self.chosen] - old
        self.outcomes = np.full(len(old), int(Outcome.CONTRADICTED))
        self.outcomes[(surface != NONE) & (rise > 0.0)] = Outcome.RAISED
        lower = np.flatnonzero((rise < 0.0) & ~is_confirmed)
        self.outcomes[lower[self._gives_way(lower, surface != NONE)]] = Outcome.LOWERED
        self.outcomes[is_confirmed] = Outcome.CONFIRMED
        self.outcomes[np.isnan(old)] = Outcome.STARTED

    def _gives_way(self, lower: Integers, has_surface: Mask) -> Mask:
        """Return a mask of the cells `lower` (k,) whose height the chosen cluster may replace."""
        cells, chosen, given = self._cells[lower], self.chosen[lower], self.given
        # If a neighbor is higher, an obstacle may cover part of the cell.
        beside = highest_around(self.state.heights, self.geometry.size, itself=False)[cells]
        alone = beside <= self.clusters.means[chosen] + self.geometry.resolution
        gives = alone & (self.state.memory.support[cells] <= given.conflict_points)
        unsure = np.flatnonzero(self.state.is_stale(given)[cells] & ~gives & has_surface[lower])
        if len(unsure):
            places, begins = self.clusters.members(chosen[unsure])
            counts = self.clusters.counts[chosen[unsure]]
            is_through = self.entries(places) >= np.repeat(
                self.state.heights[cells[unsure]], counts
            )
            through = np.add.reduceat(is_through, begins, dtype=np.int64)
            gives[unsure] = through >= given.conflict_points
        return gives

    def _merge(self, is_large: Mask) -> None:
        clusters, state, cells = self.clusters, self.state, self._cells
        old, before = state.heights[cells], state.variances[cells]
        means, new = clusters.means[self.chosen], clusters.variances[self.chosen]
        rise, merged = means - old, before * new / (before + new)
        # If a cluster agrees only because of the relief, the variances are too small.
        doubt = np.maximum((rise / clusters.threshold) ** 2 / (before + new), 1.0)
        fits, stays = self.outcomes == Outcome.CONFIRMED, ~self.is_seen
        heights = np.where(fits, old + rise * merged / new, np.where(stays, old, means))
        variances = np.where(fits, doubt * merged, np.where(stays, before, new))
        support = np.where(stays, 0, clusters.counts[self.chosen])
        support = support + np.where(stays | fits, state.memory.support[cells], 0.0)

        found = self._seen_again(is_large, heights, variances)
        grown = np.flatnonzero(found != NONE)
        self.outcomes[grown], self.chosen[grown] = Outcome.RAISED, found[grown]
        heights[grown] = clusters.means[found[grown]]
        variances[grown] = clusters.variances[found[grown]]
        support[grown] = SIGHTINGS * clusters.counts[found[grown]]

        state.heights[cells], state.memory.support[cells] = heights, support
        # Points are spread over the cell. Let u be the largest height difference to a neighbor,
        # limited to the resolution. The mean height of n points then differs from the height at the
        # center with the variance u^2 / (12 n). If a cell has far fewer points than a neighbor, its
        # points come from the tail of the neighbor's noise, which does not average out.
        size, low = self.geometry.size, heights.astype(np.float32)
        above = highest_around(state.heights, size)[cells] - low
        below = low + highest_around(-state.heights, size)[cells]
        slope = np.minimum(np.maximum(above, below), self.geometry.resolution).astype(np.float64)
        is_tail = support < TAIL * highest_around(state.memory.support, size)[cells]
        tails = 4.0 * clusters.points.variances[clusters.firsts[self.chosen]]
        least = np.maximum(slope * slope / (12.0 * support), is_tail * tails)
        least = np.where(self.is_seen, np.minimum(least, self.given.largest_share), 0.0)
        least = np.maximum(least, self.given.min_variance)
        noise = self.given.multi_height_noise * (self.outcomes >= Outcome.RAISED)
        state.variances[cells] = np.maximum(variances, least) + noise

    def _seen_again(self, is_large: Mask, heights: Numbers, variances: Numbers) -> Integers:
        """Update the candidates; return those (m,) that enough scans contained, or `NONE`."""
        clusters, cells, memory = self.clusters, self._cells, self.state.memory
        groups, means = clusters.groups, clusters.means
        candidates = is_large & (self._numbers < self.chosen[groups]) & (means > heights[groups])
        candidates &= ~clusters.agree(heights, variances)
        waits = (memory.candidate_age[cells] <= CANDIDATE_TIME)[groups]
        # With this gate, the points of a pole are accepted and outliers are rejected.
        spreads = 1.5 * (clusters.variances + clusters.spreads)
        gate = np.maximum(clusters.threshold * np.sqrt(spreads), clusters.relief)
        away = np.abs(means - memory.candidate[cells][groups])
        again = clusters.first(candidates & waits & (away <= gate))
        # If a candidate was seen only once, and not in this scan, a new candidate replaces it.
        waits &= ((again != NONE) | (memory.sightings[cells] > 1.0))[groups]
        new = clusters.first(candidates & ~waits)
        sightings = np.where(new != NONE, 1.0, memory.sightings[cells] + (again != NONE))
        seen = np.where(again != NONE, again, new)
        memory.sightings[cells] = sightings
        memory.candidate[cells] = np.where(seen != NONE, means[seen], memory.candidate[cells])
        done = (again != NONE) & (sightings >= SIGHTINGS)
        memory.candidate_age[cells[new != NONE]] = 0.0
        memory.candidate_age[cells[done]] = np.nan
        return np.where(done, again, NONE)

    def _overhangs(self, is_large: Mask) -> Integers:
        """Return the lowest overhanging cluster (m,) of each cell, or `NONE`.

        The layer `overhang` is updated. Map heights that belong to an overhang become NaN.
        """
        clusters, state, cells = self.clusters, self.state, self._cells
        groups, heights = clusters.groups, clusters.points.heights
        bottoms = heights[clusters.firsts + clusters.counts - 1]
        large = np.flatnonzero(is_large)
        above, under = large[:-1], large[1:]
        gaps = bottoms[above] - heights[clusters.firsts[under]]
        is_roof = np.zeros(len(groups), np.bool_)
        is_roof[above] = (gaps > self.given.overhang_clearance) & (groups[above] == groups[under])
        roof = clusters.last(is_roof)
        nothing = np.full(len(state.heights), np.nan, np.float32)
        layer, age = state.others.setdefault(OVERHANG, nothing), state.memory.overhang_age
        seen = roof != NONE
        layer[cells[~seen & (age[cells] >= 1e3 * self.given.scanning_duration)]] = np.nan
        layer[cells[seen]], age[cells[seen]] = bottoms[roof[seen]], 0.0
        known = clusters.agree(state.heights[cells], state.variances[cells])
        is_high = self._numbers <= roof[groups]
        state.heights[cells[clusters.first(known & is_high) != NONE]] = np.nan
        return roof
