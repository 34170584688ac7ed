# SPDX-License-Identifier: BSD-3-Clause
"""Defines `RollingMap`, which fuses the heights of successive point clouds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import GridGeometry, GridMap
from .._arrays._checks import Layer, Mask, as_points, as_rigid
from ..conversions._point_layers import as_limits, rasterize_counted
from ..plugins import check
from ._points import as_columns, distances_of, rotated
from ._state import flat

_VARIANCE, _COUNT = "variance", "count"  # layers of the fusion `mean`
_REDUCTIONS = ("max", "min", "mean", "median", "first", "last")

_Columns = Mapping[str, NDArray[Any]]
_Layers = dict[str, Layer]


class RollingMap:
    """Height map of a movable window, fused from successive point clouds.

    Args:
        geometry: size, resolution and initial position of the window.
        frame_id: frame of the points and of the map.
        layer: name of the height layer [m], which is the only basic layer of the map.
        fusion: method that fuses the heights of successive clouds. `max` keeps the largest height,
            `min` the smallest, and `last` the height from the last cloud with points in the cell.
            `mean` averages all points of all clouds, and adds the layers `variance` (population
            variance [m^2]) and `count` (number of points).
        reduction: method that computes the height of a cell from the points of one cloud: `max`,
            `min`, `mean`, `median`, `first` or `last`. With `mean` fusion, it has no effect.
        max_count: largest number of earlier points that count in the mean of a cell, for `mean`
            fusion. A limit lets the map follow changes in the ground. 0 means no limit.
        min_height, max_height: height range [m], map frame; points outside this range are ignored.

    Raises:
        ConfigError: an argument is invalid.
    """

    def __init__(
        self,
        geometry: GridGeometry,
        frame_id: str = "",
        *,
        layer: str = "elevation",
        fusion: str = "max",
        reduction: str = "max",
        max_count: int = 0,
        min_height: float = -np.inf,
        max_height: float = np.inf,
    ) -> None:
        check(fusion in _FUSIONS, "fusion", f"one of {', '.join(_FUSIONS)}", fusion)
        check(reduction in _REDUCTIONS, "reduction", f"one of {', '.join(_REDUCTIONS)}", reduction)
        check(max_count >= 0, "max_count", "a number of points, or 0", max_count)
        self._layers = {layer: reduction}
        if fusion == "mean":
            check(layer not in (_VARIANCE, _COUNT), "layer", "another name", layer)
            self._layers = {layer: "mean", _VARIANCE: "variance", _COUNT: "count"}
        self._fusion = _FUSIONS[fusion]
        self._max_count = max_count or np.inf
        self._limits = as_limits(min_height, max_height)
        # Rasterizing an empty cloud checks the arguments and creates the layers.
        self._map, _ = self._rasterized(geometry, np.empty((0, 3)), {})
        self._map.frame_id = frame_id
        self._map.basic_layers = [layer]

    @property
    def grid_map(self) -> GridMap:
        """The current map. `fuse` and `move` modify this map, so copy it to keep its values."""
        return self._map

    def move(self, position: ArrayLike) -> None:
        """Move the window by whole cells to a new center (2,) [m]. Cells that leave it are lost.

        Raises:
            GeometryError: the position is not finite, or is 2^52 or more cells away.
        """
        for region in self._map.move(position):
            if _COUNT in self._layers:
                self._map[_COUNT][region.slices] = 0.0

    def fuse(
        self,
        points: ArrayLike,
        columns: _Columns = MappingProxyType({}),
        *,
        transform: ArrayLike | None = None,
        min_range: float = 0.0,
        max_range: float = np.inf,
        position: ArrayLike | None = None,
        timestamp: int | None = None,
    ) -> dict[str, int]:
        """Fuse the points of a cloud into the map. An error leaves the map unchanged.

        Args:
            points: (N, 3) x, y, z [m], sensor frame. Points that are not finite or lie outside the
                map are ignored.
            columns: additional point values (N,) by layer name. A cell gets the mean value of the
                last cloud that has values in the cell.
            transform: (4, 4) transform from the sensor to the map frame; None if the points are in
                the map frame.
            min_range, max_range: smallest and largest distance of points from the sensor [m]; other
                points are ignored.
            position: (2,) new center of the map [m], set before fusing; None does not move the map.
            timestamp: time of the cloud [ns], which becomes the time of the map.

        Returns:
            The number of ignored points by reason, such as `outside the map`.

        Raises:
            GridMapError: an array or the position is invalid, or a column has the name of a layer
                that the fusion computes.
        """
        cloud, reasons = as_points(points), Counter[str]()
        columns = as_columns(columns, len(cloud))
        if min_range > 0.0 or max_range < np.inf:
            distances = distances_of(cloud[:, :3].T.astype(np.float64))
            kept = (distances >= min_range) & (distances <= max_range)
            reasons["nearer than min_range"] = int((distances < min_range).sum())
            reasons["farther than max_range"] = int((distances > max_range).sum())
            reasons["not finite"] = len(cloud) - int(kept.sum()) - reasons.total()
            cloud, columns = cloud[kept], {name: data[kept] for name, data in columns.items()}
        if transform is not None:
            matrix = as_rigid(transform)
            # The identity transform is skipped, so that the points keep their dtype.
            if not np.array_equal(matrix, np.eye(4)):
                cloud = (rotated(cloud, matrix[:3, :3]) + matrix[:3, 3:4]).T
        # All steps that can fail come before the map is moved.
        geometry = self._map.geometry
        if position is not None:
            geometry = geometry.shifted(geometry.index_shift(position))
        new, counted = self._rasterized(geometry, cloud, columns)
        x, y, z = cloud[~counted, :3].T
        is_finite = np.isfinite(x) & np.isfinite(y) & np.isfinite(z)
        below, above = is_finite & (z < self._limits[0]), is_finite & (z > self._limits[1])
        reasons["not finite"] += len(z) - int(is_finite.sum())
        reasons["below min_height"] = int(below.sum())
        reasons["above max_height"] = int(above.sum())
        reasons["outside the map"] = int((is_finite & ~below & ~above).sum())
        if position is not None:
            self.move(position)
        old, new = self._map, new.with_start_index(self._map.start_index)
        # Heights outside the float32 range become infinite.
        with np.errstate(over="ignore", invalid="ignore"):
            fused = self._fusion(
                {name: old[name] for name in self._layers},
                {name: new[name] for name in self._layers},
                self._max_count,
            )
        for name in new:
            if name not in fused:
                fused[name] = _newer(old[name], new[name]) if name in old else new[name]
        self._map = old.with_layers(fused)
        if timestamp is not None:
            self._map.timestamp = timestamp
        return {reason: count for reason, count in reasons.items() if count}

    def _rasterized(
        self, geometry: GridGeometry, points: ArrayLike, columns: _Columns
    ) -> tuple[GridMap, Mask]:
        empty = GridMap.from_geometry(geometry)
        return rasterize_counted(points, empty, self._layers, columns, None, self._limits)


def _newer(old: Layer, new: Layer) -> Layer:
    return np.where(np.isnan(new), old, new)


def _mean(old: _Layers, new: _Layers, max_count: float) -> _Layers:
    """Combine the means, variances and counts of old and new points.

    Formulas: Chan, Golub and LeVeque, "Algorithms for Computing the Sample Variance", 1983.
    """
    fused = {name: old[name].copy("F") for name in new}
    seen = np.flatnonzero(flat(new[_COUNT]))
    mean_1, variance_1, count_1 = (flat(new[name])[seen].astype(np.float64) for name in new)
    mean_0, variance_0, count_0 = (flat(old[name])[seen].astype(np.float64) for name in new)
    # Unknown values have weight 0, but 0 times NaN would be NaN.
    mean_0[count_0 == 0] = variance_0[count_0 == 0] = 0.0
    total = np.minimum(count_0, max_count) + count_1
    share, step = count_1 / total, mean_1 - mean_0
    mean = mean_0 + share * step
    variance = (1 - share) * (variance_0 + share * step**2) + share * variance_1
    for name, values in zip(new, (mean, variance, total), strict=True):
        flat(fused[name])[seen] = values
    return fused


_FUSIONS: dict[str, Callable[[_Layers, _Layers, float], _Layers]] = {
    "max": lambda old, new, _: {name: np.fmax(old[name], new[name]) for name in new},
    "min": lambda old, new, _: {name: np.fmin(old[name], new[name]) for name in new},
    "mean": _mean,
    "last": lambda old, new, _: {name: _newer(old[name], new[name]) for name in new},
}
"""Maps fusion names to functions that fuse the map layers with the layers of a new cloud."""
