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

_ANGLES = 36  # directions of the segments from which polygons are grown
_SECTORS = 720  # directions in which hidden edges are searched
_SHRUNK = 1.0 - 1e-9  # keeps rounded corners inside the region


def convex_inside(region: PlanarRegion, position: ArrayLike, vertices: int = 16) -> Positions:
    """Return a large convex polygon that lies inside a region and contains a position.

    As in IRIS (Deits and Tedrake, "Computing large convex regions of obstacle-free space through
    semidefinite programming", 2015), the edges of the region are cut off one by one, the nearest
    first. The distances are those from a segment instead of an ellipse. It leads from the position
    half-way to the outline; of many directions, the one with the largest polygon is chosen.

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
    grown = (_reduced(corners, vertices) for corners in _grown(edges, _half_way(edges)))
    return origin + _SHRUNK * max(grown, key=_area)


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


def _grown(edges: Positions, centers: Positions) -> list[Positions]:
    """Return a convex polygon, free of edges, around each segment from the origin to a center.

    Args:
        edges: (4, E) edges of the region, which enclose the origin.
        centers: (S, 2) ends of the segments, which cross no edge.
    """
    x0, y0, x1, y1 = edges
    x, y = centers.T[..., None]
    # The nearest points of a segment and an edge include an end of one of them.
    ways = [to_edges(edges, *end) for end in ((0.0 * x, 0.0 * y), (x, y))]
    ways += [to_edges((0.0, 0.0, -x, -y), *end) for end in ((-x0, -y0), (-x1, -y1))]
    vectors = np.array(ways)  # (4, 2, S, E)
    lengths = np.hypot(vectors[:, 0], vectors[:, 1])
    nearest = lengths.argmin(axis=0)[None, None]
    distances = lengths.min(axis=0)
    normal_x, normal_y = np.take_along_axis(vectors, nearest, axis=0)[0] / distances
    levels = np.minimum(normal_x * x0 + normal_y * y0, normal_x * x1 + normal_y * y1)
    lines = np.stack([normal_x, normal_y], axis=-1) / levels[..., None]  # line . x <= 1 is free
    is_cut = np.zeros(distances.shape, np.bool_)
    while (left := np.flatnonzero(distances.min(axis=1) < np.inf)).size:
        cut = left, distances[left].argmin(axis=1)
        is_cut[cut] = True
        along = np.minimum(lines[cut] @ edges[:2], lines[cut] @ edges[2:])
        distances[left] = np.where(along >= 1 - 1e-12, np.inf, distances[left])
        distances[cut] = np.inf
    return [_polygon(line[chosen]) for line, chosen in zip(lines, is_cut, strict=True)]


def _polygon(lines: Positions) -> Positions:
    """Return the corners of the polygon line . x <= 1 for all lines (L, 2), counter-clockwise.

    They are dual to the edges of the convex hull of `lines`.
    """
    dual = Polygon.convex_hull(lines).vertices
    after = np.roll(dual, -1, axis=0)
    step = after - dual
    return np.stack([step[:, 1], -step[:, 0]], axis=1) / _cross(dual, after)[:, None]


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
