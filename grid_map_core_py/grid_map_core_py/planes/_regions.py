# SPDX-License-Identifier: BSD-3-Clause
"""`PlanarRegions` and its elements: planes with outlines, and queries."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Layer, Positions, as_array, as_number, as_pair
from .._arrays._pieces import slices
from ..errors import GeometryError, short
from ..map._axis import BORDER_TOLERANCE
from ..map._geometry import GridGeometry
from ..regions._polygon import edge_x
from ._outlines import Outlines

_CHUNK = 2**16  # pairs of points and edges per chunk


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanarRegion:
    """Connected cells on one plane; lengths in meters, coordinates in `frame`.

    Attributes:
        id: number of the region, 1 or more.
        normal: (3,) unit normal of the plane, with z > 0.
        offset: distance of the plane from the origin along `normal`: normal . point = offset [m].
        center: (3,) point on the plane at the mean x, y of the fitted cells.
        covariance: (3, 3) covariance of the height at `center` [m] and the slopes dz/dx and dz/dy.
        rms: root-mean-square distance of the fitted cells from the plane, along z [m].
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
    """The planar regions of a map, a sequence of `PlanarRegion` in the order of their ids.

    Attributes:
        labels: (rows, cols) int32 in map order, whatever the start index of the map; the id of the
            region of each cell, 0 for none. Read-only.
        planarity: (rows, cols) float32 in map order: 1 for cells whose window is planar, 0 for
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
        outlines: Outlines,
        next_id: int,
    ) -> None:
        self.labels, self.planarity, self.geometry, self.frame = labels, planarity, geometry, frame
        self._planes, self._outlines, self._next_id = planes, outlines, next_id
        arrays: tuple[NDArray[Any], ...] = (labels, planarity, outlines.edges, *planes.values())
        for array in arrays:
            array.flags.writeable = False

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
        first, stop = self._outlines.first[number : number + 2]
        starts = self._outlines.starts[first : stop + 1]
        outer, *holes = (self._outlines.edges[:2, a:b].T for a, b in pairwise(starts))
        return PlanarRegion(
            **plane,
            offset=float(plane["normal"] @ plane["center"]),
            area=float(self._outlines.areas[number]),
            outer=outer,
            holes=holes,
            frame=self.frame,
        )

    def __repr__(self) -> str:
        return f"PlanarRegions({len(self)} regions in {self.frame!r}, {self.geometry})"

    def layers(self) -> dict[str, Layer]:
        """Return the layers `plane_id`, `plane_elevation` and `planarity`, in map order.

        `plane_elevation` is the height of the plane at the cell center [m]. Outside the regions, it
        is NaN, and `plane_id` is 0. Ids above 2**24 lose digits in float32. On a moved map, add the
        layers with `GridMap.set_unwrapped`.
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

        Outlines belong to the polygon, within 1e-9 m.
        """
        return self._nearest(as_pair(position, "position"), BORDER_TOLERANCE)

    def nearest(self, position: ArrayLike, max_distance: float) -> PlanarRegion | None:
        """Return the region whose polygon is nearest to a position x, y [m], or None.

        Args:
            position: (2,) x, y [m].
            max_distance: largest horizontal distance from the polygon [m]; may be infinite.
        """
        limit = as_number(max_distance, "max_distance")
        if not limit >= 0:
            expected = "a distance of at least 0 [m]"
            raise GeometryError(f"max_distance: expected {expected}, got {short(max_distance)}")
        return self._nearest(as_pair(position, "position"), max(limit, BORDER_TOLERANCE))

    def project(self, points: ArrayLike) -> Positions:
        """Project points onto the regions.

        On each region, the candidate is the horizontally nearest point of the polygon, at the
        height of the plane. The result is the candidate nearest to the point in 3-D.

        Args:
            points: (N, 3) x, y, z [m].

        Returns:
            (N, 3) points on the regions; NaN if there are no regions, or for points that are not
            finite.
        """
        given = as_array(points, np.float64, "points")
        if given.ndim != 2 or given.shape[1] != 3:
            raise GeometryError(f"points: expected shape (N, 3), got {given.shape}")
        result = np.full(given.shape, np.nan)
        known = np.flatnonzero(np.isfinite(given).all(axis=1)) if len(self) else np.empty(0, int)
        for part in slices(len(known), 1 + _CHUNK // (1 + self._outlines.edges.shape[1])):
            chosen = known[part]
            ahead = self._to_polygons(given[chosen, :2])
            candidates = given[chosen, None, :2] + ahead
            heights = self._heights(np.arange(len(self)), candidates)
            squares = (ahead**2).sum(axis=-1) + (heights - given[chosen, 2:]) ** 2
            best = np.arange(len(chosen)), squares.argmin(axis=1)
            result[chosen] = np.column_stack([candidates[best], heights[best]])
        return result

    def _nearest(self, position: tuple[float, float], limit: float) -> PlanarRegion | None:
        best, nearest = None, limit
        low, high = self._boxes
        beyond = np.maximum(np.maximum(low - position, position - high), 0.0)
        at_least = np.hypot(*beyond.T)
        for number in np.argsort(at_least):
            if at_least[number] > nearest:
                break
            edges = self._outlines.edges[:, slice(*self._first_edges[number : number + 2])]
            if np.logical_xor.reduce(crossed(edges, *position)):
                return self[int(number)]
            distance = np.hypot(*to_edges(edges, *position)).min()
            if distance <= nearest:
                best, nearest = int(number), distance
        return None if best is None else self[best]

    @cached_property
    def _first_edges(self) -> NDArray[np.int64]:
        """(R + 1,) index of the first edge of each region, and the number of edges."""
        return self._outlines.starts[self._outlines.first]

    @cached_property
    def _boxes(self) -> tuple[Positions, Positions]:
        """(R, 2) smallest and largest x, y of each region [m]."""
        corners, first = self._outlines.edges[:2].T, self._first_edges[:-1]
        return np.minimum.reduceat(corners, first), np.maximum.reduceat(corners, first)

    def _to_polygons(self, positions: Positions) -> Positions:
        """Return the vectors (N, R, 2) from positions (N, 2) to the polygons; 0 inside."""
        edges, starts = self._outlines.edges, self._first_edges
        x, y = positions.T[:, :, None]
        ahead_x, ahead_y = to_edges(edges, x, y)
        squares = ahead_x**2 + ahead_y**2
        nearest = np.minimum.reduceat(squares, starts[:-1], axis=1)
        # The first edge of each region at the smallest distance.
        is_nearest = squares == nearest.repeat(np.diff(starts), axis=1)
        numbers = np.where(is_nearest, np.arange(edges.shape[1]), edges.shape[1])
        chosen = np.minimum.reduceat(numbers, starts[:-1], axis=1)
        inside = np.logical_xor.reduceat(crossed(edges, x, y), starts[:-1], axis=1)
        ahead = [np.take_along_axis(values, chosen, axis=1) for values in (ahead_x, ahead_y)]
        return np.where(inside, 0.0, ahead).transpose(1, 2, 0)

    def _heights(self, numbers: Any, positions: Positions) -> Positions:
        """Return the heights of planes at positions (..., 2) [m]."""
        normals, centers = self._planes["normal"][numbers], self._planes["center"][numbers]
        ahead = ((positions - centers[..., :2]) * normals[..., :2]).sum(axis=-1)
        return np.asarray(centers[..., 2] - ahead / normals[..., 2])


def to_edges(edges: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Return the vector from each position to the nearest point of each edge."""
    start_x, start_y, end_x, end_y = edges
    step_x, step_y = end_x - start_x, end_y - start_y
    to_x, to_y = start_x - x, start_y - y
    share = np.clip((to_x * step_x + to_y * step_y) / -(step_x**2 + step_y**2), 0.0, 1.0)
    return to_x + share * step_x, to_y + share * step_y


def crossed(edges: Positions, x: Any, y: Any) -> Any:
    """Return which edges a ray from each position towards +x crosses (even-odd rule)."""
    start, end = edges[:2], edges[2:]
    return ((start[1] > y) != (end[1] > y)) & (x < edge_x(start, end, y))
