# SPDX-License-Identifier: BSD-3-Clause
"""Signed distances from points in space to the surface of a height layer."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Layer, Positions, as_array, as_finite, as_number
from .._arrays._pieces import CHUNK, slices
from ..errors import GeometryError, GridMapError, short
from ._axis import BORDER_TOLERANCE
from ._geometry import GridGeometry
from ._grid_map import GridMap

Nodes: TypeAlias = NDArray[np.float32]
"""One number per node of a field: (rows, cols, levels) float32, or a part of it."""

_Coordinates: TypeAlias = list[Positions]  # three (N,): coordinates of N points along each axis

_MOST_NODES = 2**31  # largest number of nodes (8 GiB); more nodes suggest wrong height limits
_STRIP = 1 << 16  # cells per strip; a strip fits into the cache


class SignedDistanceField:
    """Distances from points in space to the surface of a height layer.

    Each cell is modeled as a vertical line through its center: ground up to the height of the cell,
    and air above. In the air, the value is the distance to the nearest ground. In the ground, it is
    the negative distance to the nearest air. On the surface, it is 0. Outside the map, there is
    neither ground nor air.

    Exact distances are stored at the nodes of a grid in space. The nodes have the x and y of the
    cell centers, and lie on horizontal levels, which are one resolution apart. Between nodes,
    distances are interpolated trilinearly. Beyond the outermost nodes, distances are extrapolated
    linearly and only approximate. Along an axis with a single cell, they are constant.

    A height of +inf means ground at any z. A height of -inf means air at any z. Without any ground,
    all distances are +inf. Without any air, they are -inf. Gradients are 0 in both cases.

    Args:
        grid_map: the map; later changes to the map have no effect.
        layer: name of the layer with the heights [m].
        min_height: z of the lowest level [m], map frame.
        max_height: z that the highest level must reach [m]; there are at least two levels.
        unknown: treatment of cells without data (NaN): None raises an error, and "free" sets their
            height to -inf.

    Attributes:
        geometry: size, resolution and position of the map.
        resolution: distance between neighboring nodes along each axis [m].
        frame_id: coordinate frame of all points.
        timestamp: time of the map [ns].
        levels: (levels,) z of every level [m], ascending; read-only.
        distances: (rows, cols, levels) float32 distance at every node [m]; read-only. Rows and
            columns are in map order, levels are ascending.
        shape: rows, columns and levels.

    Raises:
        GeometryError: `min_height` or `max_height` is not finite, `max_height` is below
            `min_height`, or there would be more than 2**31 nodes.
        GridMapError: `unknown` is None and there are NaN cells, or `unknown` is invalid.

    Example:
        >>> grid_map = GridMap((1.0, 1.0), 0.1, layers={"elevation": 0.2})
        >>> field = SignedDistanceField(grid_map, "elevation", 0.0, 1.0)
        >>> round(field.value((0.0, 0.0, 0.7)), 6)
        0.5
    """

    def __init__(
        self,
        grid_map: GridMap,
        layer: str,
        min_height: float,
        max_height: float,
        *,
        unknown: Literal["free"] | None = None,
    ) -> None:
        self.geometry = grid_map.geometry
        self.resolution = grid_map.resolution
        self.frame_id = grid_map.frame_id
        self.timestamp = grid_map.timestamp
        heights = _heights(grid_map, layer, unknown)
        self.levels = _levels(self.geometry, min_height, max_height)
        levels = np.empty((self.levels.size, *heights.shape), np.float32)
        lowest, highest = heights.min(), heights.max()
        for level, z in zip(levels, self.levels, strict=True):
            # Distance to the ground (0 in the ground), minus distance to the air (0 in the air).
            level[...] = _to_nearest(z, heights, self.resolution) if z > lowest else 0.0
            if z < highest:
                level -= _to_nearest(heights, z, self.resolution)
        self.distances = np.moveaxis(levels, 0, 2)
        self.distances.flags.writeable = False
        self.shape = (*self.geometry.size, self.levels.size)
        x, y = self.geometry.axes_in_map_order()
        self._first = np.array([x[0], y[0], self.levels[0]])
        self._steps = self.resolution * np.array([-1.0, -1.0, 1.0])
        # Infinities cannot be interpolated. A field is infinite at all nodes or at none.
        first = float(self.distances[0, 0, 0])
        self._base = first if math.isinf(first) else 0.0
        nodes = self.distances if self._base == 0.0 else np.zeros((1, 1, 1), np.float32)
        self._counts = nodes.shape
        # Strides between neighboring nodes in memory; 0 along an axis with a single node.
        self._strides = [
            stride // nodes.itemsize if count > 1 else 0
            for stride, count in zip(nodes.strides, nodes.shape, strict=True)
        ]
        flat = nodes.ravel(order="K")
        # One view per corner; the memory index of a cell selects this corner of the cell.
        offsets = np.indices((2, 2, 2)).reshape(3, 8).T @ self._strides
        self._corner_nodes = [flat[offset:] for offset in offsets]

    def value(self, points: ArrayLike) -> float | Positions:
        """Return the signed distance at points.

        Args:
            points: (3,) or (N, 3) x, y, z [m], map frame.

        Returns:
            A float or (N,) float64 [m]; NaN where a coordinate is not finite.
        """
        given, flat = _as_points(points)
        values = np.empty(len(flat))
        # One buffer for all chunks is faster than an allocation per chunk.
        buffer = np.empty((8, min(len(flat), CHUNK)), np.float32)
        for part in slices(len(flat), CHUNK):
            places, cells = self._located(flat[part], np.floor, 2)
            corners = self._corners(cells, buffer[:, : cells[0].size])
            for place, cell in zip(places, cells, strict=True):
                low, high = corners[: len(corners) // 2], corners[len(corners) // 2 :]
                high -= low
                high *= (place - cell).astype(np.float32)
                low += high
                corners = low
            values[part] = corners[0]
        values += self._base
        return float(values[0]) if given.ndim == 1 else values

    def nearest_value(self, points: ArrayLike) -> float | Positions:
        """Return the distance at the node nearest to each point [m].

        This method is faster than `value`, but less accurate.
        """
        given, flat = _as_points(points)
        values = np.empty(len(flat))
        for part in slices(len(flat), CHUNK):
            places, cells = self._located(flat[part], np.rint, 1)
            values[part] = self._corner_nodes[0].take(self._index(cells))
            if np.isnan(sum(place.sum() for place in places)):
                values[part][np.isnan(places).any(axis=0)] = np.nan
        values += self._base
        return float(values[0]) if given.ndim == 1 else values

    def gradient(self, points: ArrayLike) -> Positions:
        """Return the derivatives of the signed distance along x, y and z.

        The result is the gradient of the interpolated `value`. It is discontinuous at planes
        through nodes. Within 1e-9 m of such a plane, the result is the mean of the gradients on
        both sides.

        Args:
            points: (3,) or (N, 3) x, y, z [m], map frame.

        Returns:
            (3,) or (N, 3) float64; NaN where a coordinate is not finite.
        """
        return self.value_and_gradient(points)[1]

    def value_and_gradient(self, points: ArrayLike) -> tuple[float | Positions, Positions]:
        """Return `value` and `gradient` at points, as fast as `gradient` alone."""
        given, flat = _as_points(points)
        values, gradients = np.empty(len(flat)), np.empty(flat.shape)
        for part in slices(len(flat), CHUNK):
            places, cells = self._located(flat[part], np.floor, 2)
            values[part], *slopes = self._values_and_slopes(places, cells)
            for axis, (slope, place) in enumerate(zip(slopes, places, strict=True)):
                nearest = np.rint(place)
                kink = np.abs(place - nearest) <= BORDER_TOLERANCE / self.resolution
                kink &= (nearest > 0) & (nearest < self._counts[axis] - 1)
                if kink.any():
                    beyond = [cell[kink] for cell in cells]
                    beyond[axis] = 2 * nearest[kink] - 1 - beyond[axis]
                    there = self._values_and_slopes([place[kink] for place in places], beyond)
                    slope[kink] = 0.5 * (slope[kink] + there[1 + axis])
                np.divide(slope, self._steps[axis], out=gradients[part, axis])
        gradients += 0.0  # Steps are negative along x and y; adding 0 turns -0 into 0.
        gradients[np.isnan(values)] = np.nan
        values += self._base
        return (float(values[0]), gradients[0]) if given.ndim == 1 else (values, gradients)

    def to_points(self, lower: float = -np.inf, upper: float = np.inf) -> NDArray[np.float32]:
        """Return the nodes whose distance is between two limits, both included.

        Args:
            lower: smallest distance [m].
            upper: largest distance [m].

        Returns:
            (N, 4) float32 x, y, z and distance [m] in the order of `distances`: z changes fastest
            (ascending), then y (descending), then x (descending).
        """
        least, most = as_number(lower, "lower"), as_number(upper, "upper")
        chosen = (self.distances >= least) & (self.distances <= most)
        points = np.empty((np.count_nonzero(chosen), 4), np.float32)
        axes = np.ix_(*self.geometry.axes_in_map_order(), self.levels)
        for axis, coordinates in enumerate(axes):
            points[:, axis] = np.broadcast_to(coordinates, self.shape)[chosen]
        points[:, 3] = self.distances[chosen]
        return points

    def __repr__(self) -> str:
        rows, columns, levels = self.shape
        return (
            f"SignedDistanceField({rows} x {columns} x {levels} nodes of {self.resolution} m, "
            f"z from {self.levels[0]:g} to {self.levels[-1]:g} m, in {self.frame_id!r})"
        )

    def _located(
        self, points: Positions, rounded: Callable[[Positions], Positions], width: int
    ) -> tuple[_Coordinates, _Coordinates]:
        """Return node coordinates [nodes], and the first of `width` nodes that each point needs."""
        places, cells = [], []
        for axis, size in enumerate(self._counts):
            place = points[:, axis] - self._first[axis]
            place *= 1 / self._steps[axis]
            cell, last = rounded(place), max(size - width, 0)
            # Usually all points are inside, and this check is faster than clamping.
            if not (cell.min() >= 0 and cell.max() <= last):
                place[~np.isfinite(place)] = np.nan
                # Unlike `np.clip`, this also turns NaN into a valid node index.
                np.fmax(np.fmin(cell, last, out=cell), 0, out=cell)
            places.append(place)
            cells.append(cell)
        return places, cells

    def _index(self, cells: _Coordinates) -> NDArray[np.intp]:
        first, second, third = self._strides
        index = cells[0] * first
        index += cells[1] * second
        index += cells[2] * third
        return index.astype(np.intp)

    def _corners(self, cells: _Coordinates, out: Nodes) -> Nodes:
        """Write the distances (8, N) at the corners of cells to `out`. x changes slowest."""
        index = self._index(cells)
        for corner, nodes in zip(out, self._corner_nodes, strict=True):
            # All indices are valid. Unlike "raise", the mode "clip" needs no temporary buffer.
            nodes.take(index, out=corner, mode="clip")
        return out

    def _values_and_slopes(self, places: _Coordinates, cells: _Coordinates) -> Nodes:
        """Return (4, N): interpolated values, then slopes per node spacing along x, y and z."""
        found: Nodes = self._corners(cells, np.empty((8, cells[0].size), np.float32))[:, None]
        for place, cell in zip(places, cells, strict=True):
            low, high = found[: len(found) // 2], found[len(found) // 2 :]
            slope = high - low
            fraction = (place - cell).astype(np.float32)
            found = np.concatenate([low + slope * fraction, slope[:, :1]], axis=1)
        jets: Nodes = found[0]
        return jets


def _as_points(values: ArrayLike) -> tuple[Positions, Positions]:
    points: Positions = as_array(values, np.float64, "points")
    if points.ndim not in {1, 2} or points.shape[-1] != 3:
        raise GeometryError(f"points: expected x, y, z of shape (3,) or (N, 3), got {points.shape}")
    return points, points.reshape(-1, 3)


def _heights(grid_map: GridMap, layer: str, unknown: str | None) -> Layer:
    """Return a C-contiguous copy of the heights (rows, cols) in map order."""
    if unknown not in (None, "free"):
        raise GridMapError(f"unknown: expected None or 'free', got {short(unknown)}")
    heights = np.array(grid_map.unwrapped(layer), order="C")
    missing = np.isnan(heights)
    if unknown is None and missing.any():
        raise GridMapError(
            f"layer {layer!r}: {np.count_nonzero(missing)} of {missing.size} cells are NaN; "
            "inpaint them first, or treat them as free space with unknown='free'"
        )
    heights[missing] = -np.inf
    return heights


def _levels(geometry: GridGeometry, min_height: float, max_height: float) -> Positions:
    lowest = as_finite(min_height, "min_height")
    highest = as_finite(max_height, "max_height", least=lowest)
    steps = (highest - lowest - BORDER_TOLERANCE) / geometry.resolution
    rows, columns = geometry.size
    if not rows * columns * (steps + 1) <= _MOST_NODES:
        raise GeometryError(
            f"min_height, max_height: expected a field of at most 2**31 nodes, got {rows} x "
            f"{columns} x {steps + 1:.0f}: z from {lowest} to {highest} m in steps of "
            f"{geometry.resolution} m"
        )
    count = max(2, math.ceil(steps) + 1)
    levels: Positions = lowest + geometry.resolution * np.arange(count, dtype=np.float64)
    levels.flags.writeable = False
    return levels


def _to_nearest(upper: ArrayLike, lower: ArrayLike, resolution: float) -> Layer:
    """Return the distances (rows, cols) from the nodes of a level to the nearest ground or air.

    For ground, `upper` is the z of the level and `lower` the heights (rows, cols). For air, the
    arguments are swapped. The vertical gap in cell c is f(c) = max(upper - lower, 0). The squared
    distance of a node is the minimum of (distance to the center of c)^2 + f(c)^2 over all cells c.
    This is the generalized distance transform of f^2, computed along one axis after the other
    (Felzenszwalb and Huttenlocher, Distance Transforms of Sampled Functions, 2012).
    """
    # Subtract in float64, because the difference of large heights may be small.
    shape = np.broadcast_shapes(np.shape(upper), np.shape(lower))
    squares: Layer = np.empty(shape, np.float32)
    np.subtract(upper, lower, out=squares, dtype=np.float64, casting="same_kind")
    np.maximum(squares, 0, out=squares)
    # If a squared gap exceeds the float32 range, it becomes infinite, and its cell is ignored.
    with np.errstate(over="ignore"):
        np.multiply(squares, squares, out=squares)
    for _ in ("x", "y"):
        rows, columns = squares.shape
        turned = np.empty((columns, rows), np.float32)
        width = max(1, _STRIP // rows)
        for first in range(0, columns, width):
            strip = slice(first, first + width)
            turned[strip] = _spread(np.ascontiguousarray(squares[:, strip]), resolution).T
        squares = turned
    return np.sqrt(squares, out=squares)


def _spread(costs: Layer, resolution: float) -> Layer:
    """Return the minimum of costs[k] + (resolution * (i - k))^2 over k, for each row i."""
    nearest, shifted = costs.copy(), np.empty_like(costs)
    least = costs.min()
    for rows in range(1, len(costs)):
        square = np.float32((rows * resolution) ** 2)
        if not least + square < nearest.max():
            break
        np.add(costs, square, out=shifted)
        np.minimum(nearest[rows:], shifted[:-rows], out=nearest[rows:])
        np.minimum(nearest[:-rows], shifted[rows:], out=nearest[:-rows])
    return nearest
