# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The layers of an elevation map, and their cells while an update works on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays._checks import Integers, Layer, Mask
from ..map._grid_map import GridMap
from ._order import Sorted, in_one_order
from ._parameters import Parameters
from ._sensors import Numbers

BOUND = 2.486
"""Standard deviations between the height and its bounds, as in the C++ package."""

BOUNDS = ("upper_bound", "lower_bound")
OWN = ("elevation", "variance", "time", *BOUNDS)
HORIZONTAL = "horizontal_variance"
OVERHANG = "overhang"

HIDDEN = ("# support", "# age", "# candidate", "# sightings", "# candidate age", "# overhang age")
"""Layers beside the weights of values, which move with the map and are not published."""

_OLDEST = 2.0**24
"""Largest whole number of milliseconds that float32 counts to."""


@dataclass
class State:
    """The layers of a map while an update works on them: flat, column after column in map order.

    Attributes:
        heights, variances, times: (cells,) of the cells; a height is NaN where it is unknown.
        support: number of points that ever supported the height.
        ages: time since the last confirmation [ms].
        others: all layers of the map by name.
        hidden: `HIDDEN`, and weights of layers of values.
    """

    heights: Numbers
    variances: Numbers
    times: NDArray[np.float32]
    support: NDArray[np.float32]
    ages: NDArray[np.float32]
    others: dict[str, NDArray[np.float32]]
    hidden: dict[str, NDArray[np.float32]]

    @classmethod
    def of(cls, grid_map: GridMap, hidden: GridMap) -> State:
        """Return the state of a map in map order; it shares the memory of some layers."""
        layers, own = (
            {name: flat(data) for name, data in part.items()} for part in (grid_map, hidden)
        )
        heights, variances = (layers[name].astype(np.float64) for name in OWN[:2])
        support, ages = (own[name] for name in HIDDEN[:2])
        return cls(heights, variances, layers["time"], support, ages, layers, own)

    def grow_older(self, milliseconds: int) -> None:
        """Let time pass [ms]."""
        for name in HIDDEN:
            if name.endswith("age"):
                np.minimum(self.hidden[name] + milliseconds, _OLDEST, out=self.hidden[name])

    def is_stale(self, given: Parameters) -> Mask:
        """Return which cells (cells,) were not confirmed for `scanning_duration`."""
        stale: Mask = self.ages >= 1e3 * given.scanning_duration
        return stale

    def confirm(self, cells: Integers | Mask, now: float) -> None:
        """Note that cells were seen at a time [s]."""
        self.times[cells], self.ages[cells] = now, 0.0

    def layers(self, parameters: Parameters) -> dict[str, NDArray[np.float32]]:
        """Return all layers of the map, flat; cells that are too uncertain are unknown."""
        with np.errstate(over="ignore", invalid="ignore"):
            heights = self.heights.astype(np.float32)
            least = np.float32(parameters.min_variance)
            variances = np.maximum(self.variances.astype(np.float32), least)
            unknown = ~np.isfinite(heights) | ~np.isfinite(variances)
            unknown |= self.variances > parameters.largest_variance
            reach = np.float32(BOUND) * np.sqrt(variances)
            own = heights, variances, self.times, heights + reach, heights - reach
        layers = self.others | dict(zip(OWN, own, strict=True))
        for data in layers.values():
            data[unknown] = np.nan
        return layers

    def keep_horizontal(self, variances: Numbers, points: Sorted, used: Mask) -> None:
        """Set the horizontal variance of each cell to the mean over the points that it uses now."""
        groups, order = points.groups[used], in_one_order(points, variances)[used]
        counts = np.bincount(groups, minlength=len(points.cells))
        seen = np.flatnonzero(counts)
        sums = np.bincount(groups, variances[order], len(points.cells))
        with np.errstate(over="ignore"):
            self.others[HORIZONTAL][points.cells[seen]] = sums[seen] / counts[seen]


def flat(layer: NDArray[Any]) -> NDArray[Any]:
    """Return a view of a layer in map order: column after column."""
    return layer.reshape(-1, order="F")


def shaped(layers: Mapping[str, NDArray[np.float32]], size: tuple[int, int]) -> dict[str, Layer]:
    """Return flat layers as (rows, cols); no copy."""
    return {name: data.reshape(size, order="F") for name, data in layers.items()}
