# SPDX-License-Identifier: BSD-3-Clause
"""Polygons in the plane of the map."""

from __future__ import annotations

import math
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Mask, Positions, as_finite, as_numbers, as_pair, as_positions
from .._arrays._pieces import slices
from ..errors import GeometryError, short
from ..map._axis import BORDER_TOLERANCE

_CHUNK = 2**16  # point-edge pairs per chunk; a chunk fits into the cache


class BoundingBox(NamedTuple):
    """Axis-aligned bounding box of a polygon.

    Attributes:
        center: (2,) center [m].
        length: (2,) side lengths along x and y [m].
    """

    center: Positions
    length: Positions


class Polygon:
    """Immutable polygon; operations such as `offset_inward` return a new polygon.

    The last vertex is connected to the first. Edges may cross. The even-odd rule defines which
    points are inside. Two polygons are equal if they have the same vertices in the same order.
    Methods raise `GeometryError` for too few vertices and for numbers that are not finite.

    Args:
        vertices: (V, 2) x, y [m], map frame.

    Example:
        >>> Polygon([(0, 0), (2, 0), (2, 1), (0, 1)]).area
        2.0
    """

    __slots__ = ("_closed", "_ends", "_vertices")

    def __init__(self, vertices: ArrayLike) -> None:
        given = as_numbers(vertices, "vertices")
        points = np.empty((0, 2)) if given.size == 0 else as_positions(given, "vertices")
        ends: tuple[list[float], ...] = ()
        if points.ndim == 2 and len(points):
            # Minima and maxima reveal NaN and infinities.
            ends = np.minimum.reduce(points).tolist(), np.maximum.reduce(points).tolist()
        if points.ndim != 2 or not all(map(math.isfinite, chain(*ends))):
            raise GeometryError(
                f"vertices: expected finite x, y of shape (V, 2), got {short(vertices)}"
            )
        # Smallest and largest x, y [m].
        self._ends = ends
        # (V + 1, 2): the last vertex, then all vertices.
        self._closed = np.concatenate((points[-1:], points))
        self._closed.flags.writeable = False
        self._vertices = self._closed[1:]

    @classmethod
    def of(cls, polygon: Polygon | ArrayLike) -> Polygon:
        """Return a polygon unchanged, or create a polygon from (V, 2) vertices [m]."""
        return polygon if isinstance(polygon, Polygon) else cls(polygon)

    @classmethod
    def from_circle(cls, center: ArrayLike, radius: float, n: int = 20) -> Polygon:
        """Return a polygon that approximates a circle.

        Args:
            center: (2,) center [m].
            radius: radius of the circle [m].
            n: number of counter-clockwise vertices, at least 2. The last one equals the first.
        """
        start = as_finite(radius, "radius", least=0.0), 0.0
        return cls(np.array(as_pair(center, "center")) + _arc(start, _number(n, 2), 1.0))

    @classmethod
    def convex_hull_of_two_circles(
        cls, center1: ArrayLike, center2: ArrayLike, radius: float, n: int = 20
    ) -> Polygon:
        """Return the convex hull of two circles with the same radius, as a polygon.

        Args:
            center1, center2: (2,) centers [m].
            radius: radius of both circles [m].
            n: number of vertices, at least 3. It is rounded up to an even number if the centers
                differ.
        """
        first, second = np.array((as_pair(center1, "center1"), as_pair(center2, "center2")))
        radius, n = as_finite(radius, "radius", least=0.0), _number(n, 3)
        if (first == second).all():
            return cls.from_circle(first, radius, n)
        x, y = radius * _normalized(second - first)
        half = (n + 1) // 2
        # Each half circle starts a quarter turn from the line between the centers.
        return cls(
            np.concatenate([first + _arc((-y, x), half, 0.5), second + _arc((y, -x), half, 0.5)])
        )

    @classmethod
    def convex_hull(cls, *polygons: Polygon | ArrayLike) -> Polygon:
        """Return the counter-clockwise convex hull of polygons (Andrew's monotone chain algorithm).

        The first vertex has the smallest x, and the smallest y of all vertices with this x.
        Vertices in the middle of an edge are omitted.

        Args:
            polygons: polygons, or (V, 2) vertices of polygons [m].
        """
        vertices = [cls.of(polygon).vertices for polygon in polygons]
        points = np.unique(np.concatenate([np.empty((0, 2)), *vertices]), axis=0).tolist()
        if len(points) < 3:
            return cls(points)
        return cls(_chain(points)[:-1] + _chain(points[::-1])[:-1])

    @property
    def vertices(self) -> Positions:
        """(V, 2) x, y [m]; read-only."""
        return self._vertices

    @property
    def area(self) -> float:
        """Enclosed area [m^2], never negative. If edges cross, parts of the area may cancel out."""
        self._need_vertices(3, "area")
        return abs(0.5 * float(_doubled_areas(self._vertices).sum()))

    @property
    def centroid(self) -> Positions:
        """(2,) centroid of the area [m]; NaN if the area is 0."""
        self._need_vertices(3, "centroid")
        points = self._vertices - self._vertices[0]
        areas = _doubled_areas(self._vertices)
        with np.errstate(invalid="ignore", divide="ignore"):
            weighted = areas @ (points + _following(points)) / (3.0 * areas.sum())
        return np.asarray(self._vertices[0] + weighted)

    @property
    def bounding_box(self) -> BoundingBox:
        """Axis-aligned bounding box of the vertices."""
        self._need_vertices(1, "bounding_box")
        lower, upper = map(np.array, self._ends)
        return BoundingBox(0.5 * (lower + upper), upper - lower)

    def is_inside(self, points: ArrayLike) -> bool | Mask:
        """Return a mask of the points inside the polygon, according to the even-odd rule.

        A point on an edge is inside if the outward normal of the edge points towards -x, or exactly
        along -y. Points on other edges are outside.

        Args:
            points: (2,) or (N, 2) x, y [m]; a point with NaN is outside.

        Returns:
            bool for one point, (N,) bool for several points.
        """
        points = as_positions(points, "points")
        flat = points.reshape(-1, 2)
        inside = np.zeros(len(flat), dtype=bool)
        vertices = self._closed.T[..., None]
        start, end = vertices[:, 1:], vertices[:, :-1]
        for part in slices(len(flat), _CHUNK // max(len(self), 1)):
            x, y = flat[part].T
            crosses = (start[1] > y) != (end[1] > y)
            crosses &= x < edge_x(start, end, y)
            np.logical_xor.reduce(crosses, axis=0, out=inside[part])
        return inside.reshape(points.shape[:-1]) if points.ndim > 1 else bool(inside[0])

    def thicken_line(self, thickness: float) -> Polygon:
        """Return the rectangle that extends `thickness` [m] to both sides of a two-vertex line."""
        if len(self._vertices) != 2 or (self._vertices[0] == self._vertices[1]).all():
            raise GeometryError(f"thicken_line: expected 2 distinct vertices, got {short(self)}")
        start, end = self._vertices
        x, y = as_finite(thickness, "thickness") * _normalized(end - start)
        across = np.array([y, -x])
        return Polygon([start + across, start - across, end - across, end + across])

    def offset_inward(self, margin: float) -> Polygon:
        """Return the polygon with all edges moved inwards by `margin` [m].

        A negative margin moves the edges outwards. The polygon must be convex, because edges at a
        reflex vertex move in the wrong direction. Vertices less than 1e-9 m apart move together. If
        the margin is too large for the polygon, the result is turned inside out.

        Raises:
            GeometryError: the polygon has vertices but no area, or the margin is not finite.
        """
        margin = as_finite(margin, "margin")
        if not len(self._vertices):
            return self
        corners, of_vertex = self._corners()
        to_previous = _normalized(np.roll(corners, 1, axis=0) - corners)
        to_next = _normalized(_following(corners) - corners)
        sine = np.abs(cross(to_previous, to_next))
        straight = sine < 1e-9
        with np.errstate(invalid="ignore", divide="ignore"):
            bisector = (to_previous + to_next) / sine[:, None]
        left = np.stack([-to_next[:, 1], to_next[:, 0]], axis=1)
        normal = np.sign(_doubled_areas(corners).sum()) * left
        moved = corners + margin * np.where(straight[:, None], normal, bisector)
        return Polygon(moved[of_vertex])

    def to_inequality_constraints(self) -> tuple[Positions, Positions]:
        """Return A and b such that `A @ x <= b` holds for the points x of a convex polygon.

        Each edge results in one row `a` of A. On the edge, `a @ (x - m)` is 1, where m is the mean
        of the vertices.

        Returns:
            A: (E, 2).
            b: (E,).

        Raises:
            GeometryError: the polygon has no area.
        """
        corners, _ = self._corners()
        mean = corners.mean(axis=0)
        start = corners - mean
        along = _following(start) - start
        distance = cross(start, along)
        # An edge whose line contains the mean cannot be scaled; convex polygons have no such edge.
        scaled = np.abs(distance) > 1e-12 * np.abs(distance).max()
        normals = np.stack([along[:, 1], -along[:, 0]], axis=1)[scaled]
        a = normals / distance[scaled, None]
        return a, 1.0 + a @ mean

    def triangulate(self) -> list[Polygon]:
        """Split a convex polygon into triangles that share the first vertex."""
        return [Polygon([self._vertices[0], *pair]) for pair in pairwise(self._vertices[1:])]

    def __len__(self) -> int:
        return len(self._vertices)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Polygon) and np.array_equal(self._vertices, other._vertices)

    def __hash__(self) -> int:
        return hash(tuple(map(tuple, self._vertices.tolist())))

    def __repr__(self) -> str:
        return f"Polygon({self._vertices.tolist()})"

    def __reduce__(self) -> tuple[object, ...]:
        # Default unpickling would return a writable array.
        return Polygon, (self._vertices,)

    def _need_vertices(self, count: int, what: str) -> None:
        if len(self._vertices) < count:
            raise GeometryError(f"{what}: expected at least {count} vertices, got {short(self)}")

    def _corners(self) -> tuple[Positions, NDArray[np.int64]]:
        """Merge repeated vertices into corners (C, 2); also return the corner of each vertex."""
        steps = np.diff(self._closed, axis=0)
        begins = np.hypot(steps[:, 0], steps[:, 1]) > BORDER_TOLERANCE
        corners = self._vertices[begins]
        if len(corners) < 3 or not (
            abs(_doubled_areas(corners).sum()) > 1e-12 * np.ptp(corners, axis=0).max() ** 2
        ):
            raise GeometryError(f"expected a polygon with an area, got {short(self)}")
        # Vertices before the first corner get index -1, which selects the last corner.
        return corners, np.cumsum(begins) - 1


def edge_x(start: Positions, end: Positions, y: Positions) -> Positions:
    """Return x at `y` on edges from `start` to `end` (2, ...), rounded as in C++ grid_map."""
    (start_x, start_y), (end_x, end_y) = start, end
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        x: Positions = (end_x - start_x) * (y - start_y) / (end_y - start_y) + start_x
    return x


def _following(points: Positions) -> Positions:
    return np.roll(points, -1, axis=0)


def cross(a: Positions, b: Positions) -> Positions:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _doubled_areas(vertices: Positions) -> Positions:
    """Return twice the signed area (V,) of the triangle between the first vertex and each edge."""
    # Far from the origin, products of large coordinates would lose precision.
    points = vertices - vertices[0]
    return cross(points, _following(points))


def _normalized(vectors: Positions) -> Positions:
    return vectors / np.hypot(vectors[..., 0], vectors[..., 1])[..., None]


def _arc(start: tuple[float, float], n: int, turns: float) -> Positions:
    """Return points (n, 2) on a counter-clockwise arc of `turns` full turns around the origin."""
    angles = np.linspace(0.0, turns * 2.0 * math.pi, n)
    cosine, sine = np.cos(angles), np.sin(angles)
    x, y = start
    return np.stack([x * cosine - y * sine, x * sine + y * cosine], axis=1)


def _chain(points: list[list[float]]) -> list[list[float]]:
    """Return the lower convex hull of ascending points, or the upper hull of descending points."""
    chain: list[list[float]] = []
    for x, y in points:
        while len(chain) > 1:
            (ax, ay), (bx, by) = chain[-2:]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:  # a turn to the left
                break
            chain.pop()
        chain.append([x, y])
    return chain


def _number(n: int, least: int) -> int:
    if not isinstance(n, int | np.integer) or n < least:
        raise GeometryError(f"n: expected at least {least} vertices, got {short(n)}")
    return int(n)
