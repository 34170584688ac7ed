# SPDX-License-Identifier: BSD-3-Clause
"""Large convex polygons inside planar regions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Positions, as_pair
from ..errors import GeometryError, short
from ..map._axis import BORDER_TOLERANCE
from ..regions._polygon import _chain
from ._regions import PlanarRegion, distances, region_edges

_ASPECTS = (1.0, 3.0, 9.0)  # ratios of the axes of the first ellipses
_ANGLES = 12  # directions of the first ellipses
_GROWN = 4  # largest polygons that are grown again from their own shape
_REPEATS = 3  # times that a polygon is grown again
_SECTORS = 720  # directions in which hidden edges are searched
_SHRUNK = 1.0 - 1e-9  # keeps rounded corners inside the region


def convex_inside(region: PlanarRegion, position: ArrayLike, vertices: int = 16) -> Positions:
    """Return a large convex polygon that lies inside a region and contains a position.

    The polygon is grown with ellipses, as in IRIS (Deits and Tedrake, "Computing large convex
    regions of obstacle-free space through semidefinite programming", 2015): the edges of the region
    are cut off one by one, the nearest first, where the distance is measured in the metric of an
    ellipse. Of several ellipses, the one with the largest polygon is chosen.

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
    edges = region_edges(region)
    inside, distance = distances(edges, origin)
    if not (inside and distance.min() > BORDER_TOLERANCE):
        expected = f"a position inside region {region.id}"
        raise GeometryError(f"position: expected {expected}, got {tuple(origin.tolist())}")
    segments = np.stack([edges[:2].T, edges[2:].T], axis=1) - origin
    segments = segments[_visible(segments, distance)]
    grown = _grow(segments, *_first_ellipses(segments))
    best = sorted((_reduced(corners, int(vertices)) for corners in grown), key=_area)[-_GROWN:]
    for _ in range(_REPEATS):
        shapes = [_moments(corners) for corners in best]
        metrics = np.stack([metric for metric, _ in shapes])
        again = _grow(segments, metrics, np.stack([center for _, center in shapes]))
        pairs = zip(best, (_reduced(corners, int(vertices)) for corners in again), strict=True)
        best = [max(pair, key=_area) for pair in pairs]
    return origin + _SHRUNK * max(best, key=_area)


def _visible(segments: Positions, near: Positions) -> Any:
    """Return a mask of the segments that may be visible from the origin.

    A convex polygon around the origin that avoids all visible segments avoids the others, too. In
    each sector, a segment that spans the whole sector hides all segments behind it.

    Args:
        segments: (E, 2, 2) ends of the segments.
        near: (E,) distances from the origin.
    """
    start, end = segments[:, 0], segments[:, 1]
    angle = np.arctan2(start[:, 1], start[:, 0])
    turn = np.arctan2(_cross(start, end), (start * end).sum(axis=1))
    unit = _SECTORS / (2 * math.pi)
    first = np.floor((angle + np.minimum(turn, 0)) * unit).astype(np.int64)
    last = np.floor((angle + np.maximum(turn, 0)) * unit).astype(np.int64)
    counts = last - first + 1
    owners = np.arange(len(segments)).repeat(counts)
    place = np.arange(owners.size) - (np.cumsum(counts) - counts)[owners]
    sectors = (first[owners] + place) % _SECTORS
    far = np.hypot(segments[..., 0], segments[..., 1]).max(axis=1)
    spans = (place > 0) & (place < counts[owners] - 1)
    hidden_from = np.full(_SECTORS, np.inf)
    np.minimum.at(hidden_from, sectors[spans], far[owners[spans]])
    return np.bincount(owners, near[owners] <= hidden_from[sectors]) > 0


def _first_ellipses(segments: Positions) -> tuple[Positions, Positions]:
    """Return linear maps (S, 2, 2) that turn ellipses into circles, and their centers (S, 2).

    The ellipses point in several directions. Their centers are at the origin, and half-way to the
    segment that is visible in this direction.
    """
    angles = np.arange(_ANGLES) * (2 * math.pi / _ANGLES)
    ahead = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    turns = np.stack([ahead, np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)], axis=1)
    start, step = segments[:, 0], segments[:, 1] - segments[:, 0]
    directions = ahead[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = _cross(directions, step)
        lengths, shares = _cross(start, step) / across, _cross(start, directions) / across
    lengths[~((lengths > 0) & (shares >= 0) & (shares <= 1))] = np.inf
    reach = lengths.min(axis=1, keepdims=True)
    half_way = 0.5 * ahead * np.where(np.isfinite(reach), reach, 0.0)
    maps = [np.array([[1.0], [aspect]]) * turns for aspect in _ASPECTS]
    half = _ANGLES // 2  # the opposite direction is the same ellipse
    metrics = [np.eye(2)[None], maps[1][:half], maps[2][:half], maps[0], maps[1]]
    centers = [np.zeros((1 + 2 * half, 2)), half_way, half_way]
    return np.concatenate(metrics), np.concatenate(centers)


def _grow(segments: Positions, metrics: Positions, centers: Positions) -> list[Positions]:
    """Return one convex polygon around the origin for each metric, free of segments.

    Args:
        segments: (E, 2, 2) ends of the edges of the region; they enclose the origin.
        metrics: (S, 2, 2) linear maps, each from an ellipse to a circle.
        centers: (S, 2) centers of the ellipses. Each polygon contains the origin, and the
            center if no edge is in between.
    """
    ends = np.einsum("sij,ekj->skei", metrics, segments)  # (S, 2, E, 2)
    cores = np.einsum("sij,sj->si", metrics, centers)
    normals, distances = _separations(ends, cores)
    levels = (normals * _closest(ends, normals)).sum(axis=-1)
    x, y = np.moveaxis(ends, -1, 0)  # (S, 2, E)
    lines: list[Any] = []
    rows = np.arange(len(metrics))
    while True:
        nearest = distances.argmin(axis=1)
        normal, level = normals[rows, nearest], levels[rows, nearest]
        valid = distances[rows, nearest] < np.inf
        if not valid.any():
            break
        lines.append((normal, level, valid))
        along = normal[:, :1, None] * x + normal[:, 1:, None] * y
        beyond = np.minimum(along[:, 0], along[:, 1]) >= level[:, None] * (1 - 1e-12)
        distances[beyond] = np.inf
        distances[rows, nearest] = np.inf
        left = np.flatnonzero(distances.min(axis=0) < np.inf)
        if 2 * left.size < distances.shape[1]:
            x, y = x.take(left, axis=2), y.take(left, axis=2)
            normals, levels = normals.take(left, axis=1), levels.take(left, axis=1)
            distances = distances.take(left, axis=1)
            if not left.size:
                break
    # Back from circles to ellipses: n . M x <= level.
    normal = np.stack([np.einsum("si,sij->sj", line[0], metrics) for line in lines], axis=1)
    level, valid = (np.stack([line[number] for line in lines], axis=1) for number in (1, 2))
    return [_intersection(normal[row][valid[row]], level[row][valid[row]]) for row in rows]


def _separations(ends: Positions, cores: Positions) -> tuple[Positions, Positions]:
    """Return unit normals (S, E, 2) from the core to each segment, and the distances (S, E).

    The core is the segment from the origin to (S, 2) `cores`. If a segment crosses it, the core
    shrinks to the origin for all segments.
    """
    # Separate coordinates (S, E) are faster than vectors.
    (x0, y0), (x1, y1) = np.moveaxis(ends, -1, 1).transpose(2, 1, 0, 3)
    along_x, along_y = x1 - x0, y1 - y0
    core_x, core_y = cores.T[:, :, None]
    sides = (core_x * y0 - core_y * x0) * (core_x * y1 - core_y * x1)
    across = along_y * x0 - along_x * y0
    blocked: Any = (sides <= 0) & (across * (across + along_x * core_y - along_y * core_x) <= 0)
    is_free = ~blocked.any(axis=1, keepdims=True)
    core_x, core_y = core_x * is_free, core_y * is_free
    length = along_x**2 + along_y**2
    core_length = np.maximum(core_x**2 + core_y**2, 1e-300)
    candidates = []  # vectors from the core to the segment
    for x, y in ((0.0 * core_x, 0.0 * core_y), (core_x, core_y)):
        share = np.clip(((x - x0) * along_x + (y - y0) * along_y) / length, 0.0, 1.0)
        candidates.append((x0 + share * along_x - x, y0 + share * along_y - y))
    for x, y in ((x0, y0), (x1, y1)):
        share = np.clip((x * core_x + y * core_y) / core_length, 0.0, 1.0)
        candidates.append((x - share * core_x, y - share * core_y))
    (best_x, best_y), *others = candidates
    best = best_x**2 + best_y**2
    for x, y in others:
        square = x**2 + y**2
        nearer = square < best
        best_x, best_y = np.where(nearer, x, best_x), np.where(nearer, y, best_y)
        best = np.minimum(best, square)
    distances = np.sqrt(best)
    return np.stack([best_x, best_y], axis=-1) / distances[..., None], distances


def _closest(ends: Positions, normals: Positions) -> Positions:
    """Return the end of each segment that is nearer along its normal (S, E, 2)."""
    along = (ends * normals[:, None]).sum(axis=-1)
    return np.where((along[:, 0] <= along[:, 1])[..., None], ends[:, 0], ends[:, 1])


def _intersection(normals: Positions, levels: Positions) -> Positions:
    """Return the corners of the polygon normal . x <= level, counter-clockwise.

    All levels are positive, so the corners are dual to the edges of the convex hull of the points
    normal / level.
    """
    points: Any = sorted({tuple(point) for point in (normals / levels[:, None]).tolist()})
    dual: Positions = np.array(_chain(points)[:-1] + _chain(points[::-1])[:-1])
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


def _moments(corners: Positions) -> tuple[Positions, Positions]:
    """Return the map from the ellipse of inertia of a polygon to a circle, and the centroid."""
    after = np.roll(corners, -1, axis=0)
    areas = _cross(corners, after)
    center = (areas @ (corners + after)) / (3 * areas.sum())
    a, b = corners - center, after - center
    areas = _cross(a, b)[:, None, None]
    # a a^T + b b^T + (a + b) (a + b)^T, without a constant factor.
    second = sum(((areas * v[:, :, None]) * v[:, None]).sum(axis=0) for v in (a, b, a + b))
    values, vectors = np.linalg.eigh(second / areas.sum())
    return (vectors / np.sqrt(values)).T, center


def _area(corners: Positions) -> float:
    return 0.5 * float(_cross(corners, np.roll(corners, -1, axis=0)).sum())


def _cross(a: Positions, b: Positions) -> Positions:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
