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
        arrays: tuple[NDArray[Any], ...] = (labels, planarity, outlines.points, *planes.values())
        for array in arrays:
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self._planes["ids"])

    @overload
    def __getitem__(self, index: int) -> PlanarRegion: ...
    @overload
    def __getitem__(self, index: slice) -> list[PlanarRegion]: ...
    def __getitem__(self, index: int | slice) -> PlanarRegion | list[PlanarRegion]:
        if isinstance(index, slice):
            return [self[number] for number in range(*index.indices(len(self)))]
        number = range(len(self))[operator.index(index)]
        of = {name: values[number] for name, values in self._planes.items()}
        first, stop = self._polygons[number : number + 2]
        starts = self._outlines.starts[first : stop + 1]
        outer, *holes = (self._outlines.points[a:b] for a, b in pairwise(starts))
        return PlanarRegion(
            id=int(of["ids"]),
            normal=of["normals"],
            offset=float(of["normals"] @ of["centers"]),
            center=of["centers"],
            covariance=of["covariances"],
            rms=float(of["rms"]),
            cells=int(of["cells"]),
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
        numbers = np.searchsorted(self._planes["ids"], self.labels[cells])
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
        if not len(self):
            return result
        known = np.flatnonzero(np.isfinite(given).all(axis=1))
        for part in slices(len(known), max(_CHUNK // self._edges.shape[1], 1)):
            chosen = known[part]
            result[chosen] = self._projected(given[chosen])
        return result

    # Edges of all polygons

    @cached_property
    def _polygons(self) -> NDArray[np.int64]:
        """(R + 1,) index of the first outline of each region, and the number of outlines."""
        return np.searchsorted(self._outlines.owners, np.arange(len(self) + 1))

    @cached_property
    def _edges(self) -> Positions:
        """(4, P) x, y of the start and x, y of the end of each edge [m]."""
        points, starts = self._outlines.points, self._outlines.starts
        after = np.arange(1, len(points) + 1)
        after[starts[1:] - 1] = starts[:-1]
        return np.concatenate([points.T, points[after].T])

    @cached_property
    def _first_edges(self) -> NDArray[np.int64]:
        """(R + 1,) index of the first edge of each region, and the number of edges."""
        return self._outlines.starts[self._polygons]

    @cached_property
    def _boxes(self) -> tuple[Positions, Positions]:
        """(R, 2) smallest and largest x, y of each region [m]."""
        points, first = self._outlines.points, self._first_edges[:-1]
        return np.minimum.reduceat(points, first), np.maximum.reduceat(points, first)

    def _nearest(self, position: tuple[float, float], limit: float) -> PlanarRegion | None:
        if not len(self):
            return None
        low, high = self._boxes
        beyond = np.maximum(np.maximum(low - position, position - high), 0.0)
        # No region is farther than its first vertex.
        vertices = self._outlines.points[self._first_edges[:-1]] - position
        reach = min(limit, float(np.hypot(*vertices.T).min()) + BORDER_TOLERANCE)
        best, nearest = None, limit
        for number in np.flatnonzero(np.hypot(*beyond.T) <= reach):
            first, stop = self._first_edges[number : number + 2]
            inside, distance = distances(self._edges[:, first:stop], position)
            if inside:
                return self[int(number)]
            if distance.min() <= nearest:
                best, nearest = int(number), float(distance.min())
        return None if best is None else self[best]

    def _projected(self, points: Positions) -> Positions:
        """Return the projections of finite points (N, 3)."""
        edges, first = self._edges, self._first_edges[:-1]
        x, y, z = points.T[:, :, None]
        ahead_x, ahead_y = _to_edges(edges, x, y)
        squares = ahead_x**2 + ahead_y**2
        nearest = np.minimum.reduceat(squares, first, axis=1)
        # The first edge of each region at the smallest distance.
        count = edges.shape[1]
        is_nearest = squares == nearest.repeat(np.diff(self._first_edges), axis=1)
        numbers = np.where(is_nearest, np.arange(count), count)
        chosen = np.minimum.reduceat(numbers, first, axis=1)
        inside = np.logical_xor.reduceat(_crossed(edges, x, y), first, axis=1)
        ahead = np.stack([ahead_x, ahead_y], axis=-1)
        ahead = np.take_along_axis(ahead, chosen[..., None], axis=1)
        ahead[inside] = 0.0
        candidates = points[:, None, :2] + ahead
        heights = self._heights(np.arange(len(self)), candidates)
        best = ((ahead**2).sum(axis=-1) + (heights - z) ** 2).argmin(axis=1)
        rows = np.arange(len(points))
        return np.column_stack([candidates[rows, best], heights[rows, best]])

    def _heights(self, numbers: Any, positions: Positions) -> Positions:
        """Return the heights of planes at positions (..., 2) [m]."""
        normals, centers = self._planes["normals"][numbers], self._planes["centers"][numbers]
        ahead = ((positions - centers[..., :2]) * normals[..., :2]).sum(axis=-1)
        return np.asarray(centers[..., 2] - ahead / normals[..., 2])


def region_edges(region: PlanarRegion) -> Positions:
    """Return the edges of all polygons of a region: (4, E) x, y of the start and the end."""
    loops = [loop.T for loop in (region.outer, *region.holes)]
    return np.hstack([np.vstack([loop, np.roll(loop, -1, axis=1)]) for loop in loops])


def distances(edges: Positions, position: Any) -> tuple[bool, Positions]:
    """Return whether edges (4, E) enclose a position (2,), and its distances (E,) from them [m]."""
    inside = np.logical_xor.reduce(_crossed(edges, *position))
    return bool(inside), np.hypot(*_to_edges(edges, *position))


def _to_edges(edges: Positions, x: Any, y: Any) -> tuple[Positions, Positions]:
    """Return the vector from each position to the nearest point of each edge."""
    start_x, start_y, end_x, end_y = edges
    step_x, step_y = end_x - start_x, end_y - start_y
    to_x, to_y = start_x - x, start_y - y
    share = (to_x * step_x + to_y * step_y) / -(step_x**2 + step_y**2)
    np.clip(share, 0.0, 1.0, out=share)
    return to_x + share * step_x, to_y + share * step_y


def _crossed(edges: Positions, x: Any, y: Any) -> Any:
    """Return which edges a ray from each position towards +x crosses (even-odd rule)."""
    start, end = edges[:2], edges[2:]
    return ((start[1] > y) != (end[1] > y)) & (x < edge_x(start, end, y))
