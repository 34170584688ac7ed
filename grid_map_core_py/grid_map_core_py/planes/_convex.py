# SPDX-License-Identifier: BSD-3-Clause
"""Large convex polygons inside planar regions."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Mask, Positions, as_pair
from ..errors import GeometryError, short
from ..map._axis import BORDER_TOLERANCE
from ..regions._polygon import Polygon
from ._regions import PlanarRegion, crossed, to_edges

_ANGLES = 24  # directions of the centers of the first circles
_GROWN = 3  # largest polygons that are grown again from their own shape
_REPEATS = 2  # times that a polygon is grown again
_SECTORS = 720  # directions in which hidden edges are searched
_SHRUNK = 1.0 - 1e-9  # keeps rounded corners inside the region


def convex_inside(region: PlanarRegion, position: ArrayLike, vertices: int = 16) -> Positions:
    """Return a large convex polygon that lies inside a region and contains a position.

    The polygon is grown with ellipses, as in IRIS (Deits and Tedrake, "Computing large convex
    regions of obstacle-free space through semidefinite programming", 2015): the edges of the region
    are cut off one by one, the nearest first, where the distance is measured in the metric of an
    ellipse. The first ellipses are circles at and around the position. The largest polygons are
    grown again with their own ellipses of inertia.

    Args:
        region: the region; its holes are avoided.
        position: (2,) x, y [m].
        vertices: largest number of corners, at least 3.

    Returns:
        (K, 2) x, y of the corners [m], counter-clockwise.

    Raises:
        GeometryError: the position is outside the region or on its outline, or `vertices` is less
            than 3.
    """
    if not isinstance(vertices, int | np.integer) or vertices < 3:
        raise GeometryError(f"vertices: expected an integer of at least 3, got {short(vertices)}")
    origin = np.array(as_pair(position, "position"))
    loops = [loop.T - origin[:, None] for loop in (region.outer, *region.holes)]
    edges = np.hstack([np.vstack([loop, np.roll(loop, -1, axis=1)]) for loop in loops])
    distance = np.hypot(*to_edges(edges, 0.0, 0.0)).min()
    if not (np.logical_xor.reduce(crossed(edges, 0.0, 0.0)) and distance > BORDER_TOLERANCE):
        expected = f"a position inside region {region.id}"
        raise GeometryError(f"position: expected {expected}, got {tuple(origin.tolist())}")
    edges = edges[:, _visible(edges)]
    circles = np.broadcast_to(np.eye(2), (_ANGLES, 2, 2))
    best = sorted(_grown(edges, circles, _half_way(edges)), key=_area)[-_GROWN:]
    for _ in range(_REPEATS):
        metrics, centers = map(np.stack, zip(*map(_ellipse, best), strict=True))
        pairs = zip(best, _grown(edges, metrics, centers), strict=True)
        best = [max(pair, key=_area) for pair in pairs]
    return origin + _SHRUNK * max((_reduced(corners, vertices) for corners in best), key=_area)


def _visible(edges: Positions) -> Mask:
    """Return a mask of the edges that may be visible from the origin.

    A convex polygon around the origin that avoids all visible edges avoids the others, too. In
    each sector, an edge that spans the whole sector hides all edges behind it.
    """
    start, end = edges[:2].T, edges[2:].T
    angle = np.arctan2(start[:, 1], start[:, 0])
    turn = np.arctan2(_cross(start, end), (start * end).sum(axis=1))
    bounds = np.sort(np.stack([angle, angle + turn]), axis=0) * (_SECTORS / (2 * math.pi))
    first, last = np.floor(bounds).astype(np.int64)
    counts = last - first + 1
    owners = np.arange(len(start)).repeat(counts)
    sectors = np.arange(owners.size) + (first - np.cumsum(counts) + counts)[owners]
    spans = (sectors > first[owners]) & (sectors < last[owners])
    far = np.maximum(np.hypot(*edges[:2]), np.hypot(*edges[2:]))
    hidden_from = np.full(_SECTORS, np.inf)
    np.minimum.at(hidden_from, sectors[spans] % _SECTORS, far[owners[spans]])
    near = np.hypot(*to_edges(edges, 0.0, 0.0))
    return np.bincount(owners, near[owners] <= hidden_from[sectors % _SECTORS]) > 0


def _half_way(edges: Positions) -> Positions:
    """Return the points (S, 2) half-way from the origin to the next edge in several directions."""
    angles = np.arange(_ANGLES) * (2 * math.pi / _ANGLES)
    ahead = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    aside = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    # An edge with its ends on both sides of a direction crosses it at 1 / inverse.
    start, end = aside @ edges[:2], aside @ edges[2:]
    across = (end - start) * ((start > 0) != (end > 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = across / (end * (ahead @ edges[:2]) - start * (ahead @ edges[2:]))
    return np.asarray(0.5 * ahead / np.nanmax(inverse, axis=1, keepdims=True))


def _grown(edges: Positions, metrics: Positions, centers: Positions) -> list[Positions]:
    """Return a convex polygon around the origin for each ellipse, free of edges.

    Args:
        edges: (4, E) edges of the region, which enclose the origin.
        metrics: (S, 2, 2) linear maps, each from an ellipse to a circle.
        centers: (S, 2) centers of the ellipses; no edge is between them and the origin.
    """
    start, end = metrics @ edges[:2], metrics @ edges[2:]
    ways, distances = _separations(start, end, metrics @ centers[..., None])
    normals = ways / distances[:, None]
    levels = np.minimum((normals * start).sum(axis=1), (normals * end).sum(axis=1))
    is_line = np.zeros(distances.shape, np.bool_)
    while (left := np.flatnonzero(distances.min(axis=1) < np.inf)).size:
        nearest = left, distances[left].argmin(axis=1)
        is_line[nearest] = True
        normal = normals.transpose(0, 2, 1)[nearest][:, None]
        along = np.minimum(normal @ start[left], normal @ end[left])[:, 0]
        is_beyond = along >= levels[nearest][:, None] * (1 - 1e-12)
        distances[left] = np.where(is_beyond, np.inf, distances[left])
        distances[nearest] = np.inf
    lines = metrics.transpose(0, 2, 1) @ normals / levels[:, None]
    return [_polygon(line[:, chosen].T) for line, chosen in zip(lines, is_line, strict=True)]


def _separations(start: Positions, end: Positions, core: Positions) -> tuple[Positions, Positions]:
    """Return the vectors (S, 2, E) from the cores to edges, each the shortest, and their lengths.

    A core is the segment from the origin to a point (S, 2, 1).
    """
    (x0, y0), (x1, y1), (x, y) = (np.moveaxis(ends, 1, 0) for ends in (start, end, core + 1e-150))
    # The nearest points of two segments include an end of one of them.
    ways = [to_edges((x0, y0, x1, y1), *end) for end in ((0.0, 0.0), (x, y))]
    ways += [to_edges((0.0, 0.0, -x, -y), *end) for end in ((-x0, -y0), (-x1, -y1))]
    vectors = np.array(ways)
    lengths = np.hypot(vectors[:, 0], vectors[:, 1])
    nearest = lengths.argmin(axis=0)[None, None]
    best = np.take_along_axis(vectors, nearest, axis=0)[0]
    return best.transpose(1, 0, 2), lengths.min(axis=0)


def _polygon(lines: Positions) -> Positions:
    """Return the corners of the polygon line . x <= 1 for all lines (L, 2), counter-clockwise.

    They are dual to the edges of the convex hull of `lines`.
    """
    dual = Polygon.convex_hull(lines).vertices
    after = np.roll(dual, -1, axis=0)
    step = after - dual
    return np.stack([step[:, 1], -step[:, 0]], axis=1) / _cross(dual, after)[:, None]


def _ellipse(corners: Positions) -> tuple[Positions, Positions]:
    """Return the map from the ellipse of inertia of a polygon to a circle, and the centroid."""
    after = np.roll(corners, -1, axis=0)
    areas = _cross(corners, after)
    center = areas @ (corners + after) / (3 * areas.sum())
    a, b = corners - center, after - center
    areas = _cross(a, b)
    # a a^T + b b^T + (a + b) (a + b)^T, without a constant factor.
    second = sum((areas * v.T) @ v for v in (a, b, a + b))
    values, vectors = np.linalg.eigh(second / areas.sum())
    return (vectors / np.sqrt(values)).T, center


def _reduced(corners: Positions, count: int) -> Positions:
    """Drop the corners that contribute the least area until `count` remain around the origin."""
    while len(corners) > count:
        before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
        lost = _cross(corners - before, after - before)
        # Without the corner, the origin must stay to the left of the new edge.
        lost[_cross(after - before, -before) <= 1e-9 * np.abs(lost)] = np.inf
        corners = np.delete(corners, int(lost.argmin()), axis=0)
    return corners


def _area(corners: Positions) -> float:
    return float(_cross(corners, np.roll(corners, -1, axis=0)).sum())


def _cross(a: Positions, b: Positions) -> Positions:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
