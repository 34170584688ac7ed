# SPDX-License-Identifier: BSD-3-Clause
"""Working copy of the layers of an elevation map, and functions on cell neighborhoods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Integers, Layer, Mask, Size, is_name
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._clusters import Sorted, in_one_order
from ._parameters import Numbers, Parameters

BOUND = 2.486
"""Distance between a height and its bounds [standard deviations], as in the C++ package."""

BOUNDS = ("upper_bound", "lower_bound")
FUSED = ("elevation", "variance")
"""Layers that scans are fused into; the other layers in `OWN` are derived."""

OWN = (*FUSED, "time", *BOUNDS)
HORIZONTAL = "horizontal_variance"
OVERHANG = "overhang"

_OLDEST = 2.0**24
"""Upper limit of ages [ms]; float32 represents all integers up to this value."""


@dataclass
class Memory:
    """State of the cells that is not part of the map, as arrays (cells,); NaN means not set.

    Attributes:
        support: number of points that have ever supported the height.
        age: time since the last confirmation [ms].
        candidate: height [m] of a cluster above the surface that may become the surface.
        sightings: number of scans in which the candidate was seen.
        candidate_age: time since the candidate was first seen [ms].
        overhang_age: time since the overhang was last seen [ms].
    """

    support: NDArray[np.float32]
    age: NDArray[np.float32]
    candidate: NDArray[np.float32]
    sightings: NDArray[np.float32]
    candidate_age: NDArray[np.float32]
    overhang_age: NDArray[np.float32]


HIDDEN = tuple(f"# {field.name}" for field in fields(Memory))
"""Names of the unpublished layers that store a `Memory`."""


def is_value_name(name: str) -> bool:
    """Return whether `name` can name a layer of point values or of an image channel."""
    return is_name(name) and name not in (*OWN, HORIZONTAL, OVERHANG, *HIDDEN)


@dataclass
class State:
    """Flat layers of a map during an update, column by column in map order.

    Attributes:
        heights, variances, times: values (cells,); unknown heights are NaN.
        others: layers of the map by name. The method `layers` recomputes those in `OWN`.
        weights: layers with the weights of point values; see `ValueFusion.fuse`.
    """

    heights: Numbers
    variances: Numbers
    times: NDArray[np.float32]
    others: dict[str, NDArray[np.float32]]
    memory: Memory
    weights: dict[str, NDArray[np.float32]]

    @classmethod
    def of(cls, grid_map: GridMap, hidden: GridMap) -> State:
        """Create the state from maps in map order. Some layers share memory with the maps."""
        layers, own = (
            {name: flat(data) for name, data in part.items()} for part in (grid_map, hidden)
        )
        heights, variances = (layers[name].astype(np.float64) for name in FUSED)
        memory = Memory(*(own.pop(name) for name in HIDDEN))
        return cls(heights, variances, layers["time"], layers, memory, own)

    def grow_older(self, milliseconds: int) -> None:
        for age in (self.memory.age, self.memory.candidate_age, self.memory.overhang_age):
            np.minimum(age + milliseconds, _OLDEST, out=age)

    def lift(self, height: float) -> None:
        for layer in (self.heights, self.memory.candidate, self.others.get(OVERHANG)):
            if layer is not None:
                layer += height

    def hidden(self) -> dict[str, NDArray[np.float32]]:
        """Return the unpublished layers by name, as flat arrays."""
        return dict(zip(HIDDEN, vars(self.memory).values(), strict=True)) | self.weights

    def is_stale(self, given: Parameters) -> Mask:
        return self.memory.age >= 1e3 * given.scanning_duration

    def confirm(self, cells: Integers | Mask, now: float) -> None:
        self.times[cells], self.memory.age[cells] = now, 0.0

    def layers(self, parameters: Parameters) -> dict[str, NDArray[np.float32]]:
        """Return all layers as flat arrays. Cells whose variance exceeds the limit become NaN."""
        with np.errstate(over="ignore", invalid="ignore"):
            heights = self.heights.astype(np.float32)
            least = np.float32(parameters.min_variance)
            variances = np.maximum(self.variances.astype(np.float32), least)
            unknown = ~np.isfinite(heights) | ~np.isfinite(variances)
            unknown |= self.variances > parameters.largest_variance
            reach = np.float32(BOUND) * np.sqrt(variances)
            own = heights, variances, self.times, heights + reach, heights - reach
        layers = self.others | dict(zip(OWN, own, strict=True))
        for data in (*layers.values(), self.memory.support):
            data[unknown] = np.nan
        return layers

    def keep_horizontal(self, variances: Numbers, points: Sorted, used: Mask) -> None:
        """Set the horizontal variance of cells to the mean of their `used` points."""
        groups, order = points.groups[used], in_one_order(points, variances)[used]
        counts = np.bincount(groups, minlength=len(points.cells))
        seen = np.flatnonzero(counts)
        sums = np.bincount(groups, variances[order], len(points.cells))
        with np.errstate(over="ignore"):
            self.others[HORIZONTAL][points.cells[seen]] = sums[seen] / counts[seen]


def flat(layer: NDArray[Any]) -> NDArray[Any]:
    """Return a flat view of a layer in map order, column by column."""
    return layer.reshape(-1, order="F")


def shaped(layers: Mapping[str, NDArray[np.float32]], size: tuple[int, int]) -> dict[str, Layer]:
    return {name: data.reshape(size, order="F") for name, data in layers.items()}


def highest_around(
    values: NDArray[Any], size: Size, radius: int = 1, *, itself: bool = True
) -> NDArray[np.float32]:
    """Return the maximum (cells,) around each cell, ignoring NaN; -inf if all are NaN."""
    kernel = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    kernel[radius, radius] = itself
    # `cv2.dilate` is ten times as fast for float32 as for float64.
    with np.errstate(over="ignore"):
        known = np.fmax(values.astype(np.float32), np.float32(-np.inf)).reshape(size[::-1])
    around = cv2.dilate(known, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=-np.inf)
    return np.asarray(around, np.float32).ravel()


def at_centers(
    points: NDArray[np.float64],
    cells: Integers,
    heights: Numbers,
    variances: Numbers,
    geometry: GridGeometry,
    threshold: float,
) -> Numbers:
    """Return the heights (n,) [m] of `points` (3, n), moved along the slope to the cell centers.

    Along each axis, a cell has two slopes, one to each neighbor. The less steep slope is used. The
    slope is 0 in three cases:

    - The two slopes have opposite signs.
    - A height difference is at most `threshold` standard deviations.
    - A neighbor is unknown or outside the map.
    """
    seen = np.zeros(len(heights), np.bool_)
    seen[cells] = True
    known = np.flatnonzero(seen & ~np.isnan(heights))
    result: Numbers = points[2].copy()
    rows = geometry.size[0]
    lines = (known % rows, cells % rows), (known // rows, cells // rows)
    for axis, (centers, step) in enumerate(
        zip(geometry.axes_in_map_order(), (1, rows), strict=True)
    ):
        line, place = lines[axis]
        rises = []
        for side, is_there in ((-step, line > 0), (step, line < len(centers) - 1)):
            beside = np.where(is_there, known + side, known)
            rise = np.copysign(1.0, side) * (heights[beside] - heights[known])
            gate = threshold * np.sqrt(variances[beside] + variances[known])
            rises.append(np.where(np.abs(rise) > gate, rise, 0.0))
        one, other = rises
        slopes = np.zeros(len(heights))
        smaller = np.where(np.abs(one) < np.abs(other), one, other)
        slopes[known] = np.where(one * other > 0.0, smaller, 0.0)
        sloping = np.flatnonzero(slopes[cells])
        # Rows and columns are in the order of descending x and y.
        away = (centers[place[sloping]] - points[axis, sloping]) / geometry.resolution
        result[sloping] -= slopes[cells[sloping]] * away
    return result
