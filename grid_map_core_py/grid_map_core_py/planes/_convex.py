# SPDX-License-Identifier: BSD-3-Clause
"""Large convex polygons inside planar regions."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Positions, as_pair
from ..errors import GeometryError, short
from ..regions._polygon import Polygon, cross
from ._regions import PlanarRegion, edges_of, to_edges

_DIRECTIONS = np.exp(2j * math.pi * np.arange(36) / 36)  # as x + 1j * y
_SEGMENTS = 8  # number of directions, those with the farthest outline, of the segments
_CLEARANCE = 1e-6  # closer to an edge, its direction from the position would be imprecise [m]
_SHRUNK = 1.0 - 1e-9  # keeps rounded corners inside the region


def convex_inside(region: PlanarRegion, position: ArrayLike, vertices: int = 16) -> Positions:
    """Return a large convex polygon that lies inside a region and contains a position.

    The polygon is bounded by lines that separate it from the edges of the region, beginning with
    the nearest edge. This method is based on IRIS (Deits and Tedrake, "Computing large convex
    regions of obstacle-free space through semidefinite programming", 2015). IRIS measures distances
    from an ellipse. This function measures distances from a segment that starts at the position and
    ends halfway to the outline. It tries segments in several directions, and returns the largest
    polygon.

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
    # After a turn by each direction, an edge across the x axis meets it at `place`.
    turn = _DIRECTIONS.conj()
    starts, ends = (np.multiply.outer(x + 1j * y, turn) for x, y in edges.reshape(2, 2, -1))
    across = np.nonzero((starts.imag > 0) != (ends.imag > 0))
    start, end = starts[across], ends[across]
    place = (start.conj() * end).imag / (end - start).imag
    outline = np.full(turn.size, np.inf)
    np.minimum.at(outline, across[1], np.where(place > 0, place, np.inf))
    # A direction may also graze a corner or run along an edge.
    grazed = np.nonzero((np.abs(starts.imag) <= _CLEARANCE) & (starts.real > 0))
    np.minimum.at(outline, grazed[1], starts[grazed].real)
    half_way = (0.5 * outline * _DIRECTIONS)[np.argsort(outline)[-_SEGMENTS:]]
    best = max((_grown(edges, end.real, end.imag) for end in half_way), key=_area)
    return origin + _SHRUNK * _reduced(best, vertices)


def _grown(edges: Positions, x: float, y: float) -> Positions:
    """Return a convex polygon (K, 2) that contains (0, 0) and (x, y) but no part of `edges`."""
    # The nearest points of a segment and an edge include an end of one of them.
    ways = [to_edges(edges, *end) for end in ((0.0, 0.0), (x, y))]
    ways += [to_edges((0.0, 0.0, -x, -y), *-end) for end in edges.reshape(2, 2, -1)]
    vectors = np.array([way[:2] for way in ways])
    nearest = (vectors**2).sum(axis=1).argmin(axis=0)
    normals = np.take_along_axis(vectors, nearest[None, None], axis=0)[0].T
    ends, squares, lines = edges.reshape(2, 2, -1), (normals**2).sum(axis=1), list[Positions]()
    while squares.size:
        cut = squares.argmin()
        along = (normals[cut] @ ends).min(axis=0)
        lines.append(normals[cut] / along[cut])
        is_left = along < (1 - 1e-12) * along[cut]
        is_left[cut] = False
        left = np.flatnonzero(is_left)
        ends, normals, squares = ends[..., left], normals[left], squares[left]
    # The corners of the polygon line . x <= 1 are dual to the edges of the hull of all lines.
    dual = Polygon.convex_hull(np.array(lines)).vertices
    after = np.roll(dual, -1, axis=0)
    step = after - dual
    return np.stack([step[:, 1], -step[:, 0]], axis=1) / cross(dual, after)[:, None]


def _area(corners: Positions) -> float:
    return float(cross(corners, np.roll(corners, -1, axis=0)).sum())


def _reduced(corners: Positions, count: int) -> Positions:
    """Remove the corners that add the least area until `count` remain. The origin stays inside."""
    while len(corners) > count:
        before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
        lost = cross(corners - before, after - before)
        # Without the corner, the origin must stay to the left of the new edge.
        lost[cross(after - before, -before) <= 1e-9 * np.abs(lost)] = np.inf
        corners = np.delete(corners, int(lost.argmin()), axis=0)
    return corners
