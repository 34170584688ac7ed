# SPDX-License-Identifier: BSD-3-Clause
"""`PlanarRegions` and its elements: planes with outlines, and queries."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Layer, Positions, as_array, as_number, as_pair
from .._arrays._pieces import slices
from ..errors import GeometryError, short
from ..map._axis import BORDER_TOLERANCE
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap

_CHUNK = 2**16  # pairs of points and edges per chunk


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanarRegion:
    """Region of connected cells that lie on one plane. Coordinates are in `frame` [m].

    Attributes:
        id: number of the region, 1 or more.
        normal: (3,) unit normal of the plane, with z > 0.
        offset: signed distance of the plane from the origin along `normal` [m]. For each point on
            the plane, `normal @ point` equals `offset`.
        center: (3,) point on the plane at the mean x, y of the fitted cells.
        covariance: (3, 3) covariance of the height at `center` [m] and the slopes dz/dx and dz/dy.
        rms: root mean square of the vertical distances of the fitted cells from the plane [m].
        cells: number of cells.
        area: area of the outer polygon without the holes, seen from above [m^2].
        outer: (N, 2) x, y of the outer polygon, counter-clockwise and not closed. It runs through
            the centers of the border cells.
        holes: (M, 2) x, y of each hole, clockwise and not closed.
        frame: frame of the map.
    """

    id: int
    normal: Positions
    offset: float
    center: Positions
    covariance: Positions
    rms: float
    cells: int
    area: float
    outer: Positions
    holes: list[Positions]
    frame: str


class PlanarRegions(Sequence[PlanarRegion]):
    """Sequence of the planar regions of a map (`PlanarRegion`), in the order of their ids.

    Attributes:
        labels: (rows, cols) int32 in map order: region id of each cell, 0 for none. Read-only.
        planarity: (rows, cols) float32 in map order: 1 for cells with planar surroundings, 0 for
            other cells, NaN for cells without a height. Read-only.
        geometry: geometry of the map.
        frame: frame of the map.
    """

    def __init__(
        self,
        labels: NDArray[np.int32],
        planarity: Layer,
        geometry: GridGeometry,
        frame: str,
        planes: dict[str, NDArray[Any]],
        outlines: list[list[NDArray[np.int32]]],
        next_id: int,
    ) -> None:
        self.labels, self.planarity, self.geometry, self.frame = labels, planarity, geometry, frame
        self._next_id = next_id
        cells, starts = edges_of([outline for region in outlines for outline in region])
        axes = geometry.axes_in_map_order() * 2
        self._edges = np.array([axis[places] for axis, places in zip(axes, cells, strict=True)])
        self._first_loops = np.cumsum([0] + [len(region) for region in outlines])
        self._first_edges = starts[self._first_loops]
        x, y, end_x, end_y = self._edges
        triangles = 0.5 * ((x - x[:1]) * (end_y - y[:1]) - (y - y[:1]) * (end_x - x[:1]))
        areas = np.add.reduceat(triangles, self._first_edges[:-1])
        self._planes = planes | {"area": areas}
        for array in (labels, planarity, self._edges, *self._planes.values()):
            array.flags.writeable = False
        self._loops = [self._edges[:2, first:end].T for first, end in pairwise(starts)]

    def __len__(self) -> int:
        return len(self._planes["id"])

    @overload
    def __getitem__(self, index: int) -> PlanarRegion: ...
    @overload
    def __getitem__(self, index: slice) -> list[PlanarRegion]: ...
    def __getitem__(self, index: int | slice) -> PlanarRegion | list[PlanarRegion]:
        if isinstance(index, slice):
            return [self[number] for number in range(*index.indices(len(self)))]
        number = range(len(self))[operator.index(index)]
        plane = {name: values[number] for name, values in self._planes.items()}
        plane = {name: value if value.ndim else value.item() for name, value in plane.items()}
        outer, *holes = self._loops[slice(*self._first_loops[number : number + 2])]
        return PlanarRegion(**plane, outer=outer, holes=holes, frame=self.frame)

    def __repr__(self) -> str:
        return f"PlanarRegions({len(self)} regions in {self.frame!r}, {self.geometry})"

    def fits(self, grid_map: GridMap) -> bool:
        """Return whether a map has the same frame and resolution as these regions."""
        resolutions = self.geometry.resolution, grid_map.resolution
        return self.frame == grid_map.frame_id and math.isclose(*resolutions, rel_tol=1e-6)

    def layers(self) -> dict[str, Layer]:
        """Return the layers `plane_id`, `plane_elevation` and `planarity`, in map order.

        `plane_elevation` is the height of the plane at the cell center [m]. Outside the regions,
        `plane_elevation` is NaN and `plane_id` is 0. float32 cannot represent all ids above 2**24
        exactly. Add the layers to a map with `GridMap.set_unwrapped`, which handles the start
        index.
        """
        x, y = self.geometry.axes_in_map_order()
        heights = np.full(self.labels.shape, np.nan, np.float32, order="F")
        cells = np.nonzero(self.labels)
        numbers = np.searchsorted(self._planes["id"], self.labels[cells])
        heights[cells] = self._heights(numbers, np.stack([x[cells[0]], y[cells[1]]], axis=1))
        ids = np.asarray(self.labels, np.float32)
        return {"plane_id": ids, "plane_elevation": heights, "planarity": self.planarity}

    def at(self, position: ArrayLike) -> PlanarRegion | None:
        """Return the region whose polygon contains a position x, y [m], or None.

        A position within 1e-9 m of an outline counts as inside.
        """
        return self.nearest(position, 0.0)

    def nearest(self, position: ArrayLike, max_distance: float) -> PlanarRegion | None:
        """Return the region whose polygon is nearest to a position, or None if all are too far.

        Args:
            position: (2,) x, y [m].
            max_distance: largest horizontal distance from the polygon [m]; may be infinite.
        """
        limit = as_number(max_distance, "max_distance")
        if not limit >= 0:
            expected = "a distance of at least 0 [m]"
            raise GeometryError(f"max_distance: expected {expected}, got {short(max_distance)}")
        place = np.array([as_pair(position, "position")])
        if not len(self):
            return None
        distances = np.hypot(*self._to_polygons(place)[0].T)
        best = int(distances.argmin())
        return self[best] if distances[best] <= limit + BORDER_TOLERANCE else None

    def project(self, points: ArrayLike) -> Positions:
        """Project points onto the regions.

        In each region, the horizontally nearest point of the polygon is found, and placed on the
        plane. The result is the nearest of these points in 3-D.

        Args:
            points: (N, 3) x, y, z [m].

        Returns:
            (N, 3) points on the regions. A point that is not finite results in NaN. Without any
            regions, all results are NaN.
        """
        given = as_array(points, np.float64, "points")
        if given.ndim != 2 or given.shape[1] != 3:
            raise GeometryError(f"points: expected shape (N, 3), got {given.shape}")
        result = np.full(given.shape, np.nan)
        known = np.flatnonzero(np.isfinite(given).all(axis=1)) if len(self) else np.empty(0, int)
        for part in slices(len(known), 1 + _CHUNK // (1 + self._edges.shape[1])):
            chosen = known[part]
            ahead = self._to_polygons(given[chosen, :2])
            candidates = given[chosen, None, :2] + ahead
            heights = self._heights(np.arange(len(self)), candidates)
            squares = (ahead**2).sum(axis=-1) + (heights - given[chosen, 2:]) ** 2
            best = np.arange(len(chosen)), squares.argmin(axis=1)
            result[chosen] = np.column_stack([candidates[best], heights[best]])
        return result

    def _to_polygons(self, positions: Positions) -> Positions:
        """Return vectors (N, R, 2) from positions (N, 2) to R polygons; 0 inside a polygon."""
        firsts = self._first_edges[:-1]
        ahead_x, ahead_y, crossed = to_edges(self._edges, *positions.T[:, :, None])
        squares = ahead_x**2 + ahead_y**2
        nearest = np.minimum.reduceat(squares, firsts, axis=1)
        # The first edge of each region at the smallest distance.
        is_nearest = squares == nearest.repeat(np.diff(self._first_edges), axis=1)
        numbers = np.where(is_nearest, np.arange(squares.shape[1]), squares.shape[1])
        chosen = np.minimum.reduceat(numbers, firsts, axis=1)
        inside = np.logical_xor.reduceat(crossed, firsts, axis=1)
        ahead = [np.take_along_axis(values, chosen, axis=1) for values in (ahead_x, ahead_y)]
        return np.where(inside, 0.0, ahead).transpose(1, 2, 0)

    def _heights(self, numbers: Any, positions: Positions) -> Positions:
        """Return the heights [m] of the planes with indices `numbers` at positions (..., 2)."""
        normals, centers = self._planes["normal"][numbers], self._planes["center"][numbers]
        ahead = ((positions - centers[..., :2]) * normals[..., :2]).sum(axis=-1)
        return np.asarray(centers[..., 2] - ahead / normals[..., 2])


def edges_of(outlines: Sequence[NDArray[Any]]) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return the edges of C closed outlines, each given as an array (V, 2) of vertices.

    Returns:
        edges: (4, E) start x, start y, end x and end y of each edge.
        starts: (C + 1,) index of each outline's first edge, followed by E.
    """
    vertices = np.concatenate([np.empty((0, 2), np.int32), *outlines]).T
    starts = np.cumsum([0] + [len(outline) for outline in outlines])
    after = np.arange(1, starts[-1] + 1)
    after[starts[1:] - 1] = starts[:-1]
    return np.concatenate([vertices, vertices[:, after]]), starts


def to_edges(edges: Any, x: Any, y: Any) -> tuple[Any, Any, Any]:
    """Return vectors x, y from positions to the nearest points on edges (4, E), and a mask.

    The mask contains the edges that a ray from the position towards +x crosses. Inside a polygon,
    the number of crossed edges is odd (even-odd rule).
    """
    start_x, start_y, end_x, end_y = edges
    step_x, step_y = end_x - start_x, end_y - start_y
    to_x, to_y = start_x - x, start_y - y
    share = np.clip((to_x * step_x + to_y * step_y) / -(step_x**2 + step_y**2), 0.0, 1.0)
    is_left = (to_x * step_y > to_y * step_x) == (step_y > 0)  # of the edge, seen upwards
    crossed = is_left & ((to_y > 0) != (end_y > y))
    return to_x + share * step_x, to_y + share * step_y, crossed
