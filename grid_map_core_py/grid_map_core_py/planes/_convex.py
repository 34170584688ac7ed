# SPDX-License-Identifier: BSD-3-Clause
"""Large convex polygons inside planar regions."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Positions, as_pair
from ..errors import GeometryError, short
from ..regions._polygon import Polygon
from ._regions import PlanarRegion, edges_of, to_edges

_ROUNDS = 3
_ANGLES = np.arange(6) * math.pi / 6  # directions of the long axes of ellipses
_SHAPES = [np.eye(2)] + [
    np.array([[math.cos(a) / 4, math.sin(a) / 4], [-math.sin(a), math.cos(a)]]) for a in _ANGLES
]
"""Matrices that turn a circle and ellipses into circles."""

_CLEARANCE = 1e-6  # closer to an edge, its direction from the position would be imprecise [m]
_SHRUNK = 1.0 - 1e-9  # keeps rounded corners inside the region


def convex_inside(region: PlanarRegion, position: ArrayLike, vertices: int = 16) -> Positions:
    """Return a large convex polygon that lies inside a region and contains a position.

    As in IRIS (Deits and Tedrake, "Computing large convex regions of obstacle-free space through
    semidefinite programming", 2015), an ellipse grows and cuts off each edge of the region that it
    meets. Ellipses of several shapes grow around the position, then around the centroid of the
    largest polygon so far.

    Args:
        region: the region; its holes are avoided.
        position: (2,) x, y [m].
        vertices: largest number of corners, at least 3.

    Returns:
        (K, 2) x, y of the corners [m], counter-clockwise.

    Raises:
        GeometryError: the position is outside the region or within 1e-6 m of its outline, or
            `vertices` is less than 3.
    """
    if not isinstance(vertices, int | np.integer) or vertices < 3:
        raise GeometryError(f"vertices: expected an integer of at least 3, got {short(vertices)}")
    origin = np.array(as_pair(position, "position"))
    edges, _ = edges_of([loop - origin for loop in (region.outer, *region.holes)])
    x, y, crossed = to_edges(edges, 0.0, 0.0)
    if not (np.logical_xor.reduce(crossed) and np.hypot(x, y).min() > _CLEARANCE):
        expected = f"a position inside region {region.id}"
        raise GeometryError(f"position: expected {expected}, got {tuple(origin.tolist())}")
    center, grown = np.zeros(2), list[Positions]()
    for _ in range(_ROUNDS):
        around = edges.reshape(2, 2, -1) - center[:, None]
        grown += [center + _grown(shape @ around) @ np.linalg.inv(shape).T for shape in _SHAPES]
        grown = [max(grown, key=_area)]
        center = Polygon(grown[0]).centroid
    return origin + _SHRUNK * _reduced(grown[0], vertices)


def _grown(ends: Positions) -> Positions:
    """Return the polygon (K, 2) that remains after cutting off edges, the nearest first.

    Args:
        ends: (2, 2, E) start and end, x and y, of edges that enclose the origin.
    """
    x, y, _ = to_edges(ends.reshape(4, -1), 0.0, 0.0)
    normals, distances, lines = np.stack([x, y], axis=1), np.hypot(x, y), []
    while distances.size:
        cut = distances.argmin()
        along = (normals[cut] @ ends).min(axis=0)
        lines.append(normals[cut] / along[cut])
        is_left = along < (1 - 1e-12) * along[cut]
        is_left[cut] = False
        left = np.flatnonzero(is_left)
        ends, normals, distances = ends[..., left], normals[left], distances[left]
    # The corners of the polygon line . x <= 1 are dual to the edges of the hull of all lines.
    dual = Polygon.convex_hull(np.array(lines)).vertices
    after = np.roll(dual, -1, axis=0)
    step = after - dual
    return np.stack([step[:, 1], -step[:, 0]], axis=1) / _cross(dual, after)[:, None]


def _area(corners: Positions) -> float:
    """Return twice the area of a polygon, or 0 if the origin is not inside."""
    parts = _cross(corners, np.roll(corners, -1, axis=0))
    return float(parts.sum()) if parts.min() > 0 else 0.0


def _reduced(corners: Positions, count: int) -> Positions:
    """Drop the corners that contribute the least area until `count` remain around the origin."""
    while len(corners) > count:
        before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
        lost = _cross(corners - before, after - before)
        # Without the corner, the origin must stay to the left of the new edge.
        lost[_cross(after - before, -before) <= 1e-9 * np.abs(lost)] = np.inf
        corners = np.delete(corners, int(lost.argmin()), axis=0)
    return corners


def _cross(a: Positions, b: Positions) -> Positions:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
