# SPDX-License-Identifier: BSD-3-Clause
"""Beams against a layer of heights."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Mask, Positions, as_array, as_number
from ..errors import GeometryError, short
from ..map import GridMap
from ._ray_loops import in_lockstep, one_by_one


def cast_rays(
    grid_map: GridMap,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    layer: str = "elevation",
    max_range: float = np.inf,
) -> Positions:
    """Return how far beams go until they meet the surface of a layer.

    The surface is bilinear between the centers of cells and goes on level from the outermost
    centers to the border, as `GridMap.at_position` with `Interpolation.LINEAR` has it. A step
    between neighboring cells is therefore as wide as a cell. Between four centers of which one is
    not finite, there is a hole. The ground below the surface is solid: a beam that comes from
    beside the map or out of a hole returns from the side of the ground.

    Args:
        grid_map: the terrain, which may have been moved.
        origins: (N, 3) where the beams begin, or (3,) for all of them [m], map frame.
        directions: (N, 3) of any length but 0, map frame.
        layer: name of the layer of heights [m].
        max_range: range from which on a beam does not return [m].

    Returns:
        (N,) ranges [m]; NaN for beams that do not return, begin on or below the surface, or are not
        finite. The points are `origins + ranges[:, None] * directions` for directions of length 1.

    Raises:
        GeometryError: an array has another shape, or `max_range` is not a number above 0.
        LayerNotFoundError: the map has no such layer.
    """
    begins, along = _checked(origins, directions)
    limit = as_number(max_range, "max_range")
    if not limit > 0.0:
        raise GeometryError(f"max_range: expected a number above 0, got {short(max_range)}")
    geometry, surface = grid_map.geometry, grid_map.unwrapped(layer)
    known = np.isfinite(surface)
    heights = np.pad(np.where(known, surface, np.nan), 1, mode="edge").astype(np.float32, order="C")
    ranges = np.full(len(along), np.nan)
    with np.errstate(all="ignore"):
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        # In cells of the padded heights, whose first center is one before that of the map.
        corner = geometry.corner + 0.5 * geometry.resolution
        rays = np.empty((6, len(along)))
        rays[:2] = ((corner - begins[:, :2]) / geometry.resolution).T
        rays[2] = begins[:, 2]
        rays[3:5] = (along[:, :2] / -geometry.resolution).T
        rays[5] = along[:, 2]
        highest = float(surface[known].max(initial=-np.inf))
        span = _span(rays, geometry.size, highest, limit)
    chosen = np.flatnonzero(span[0] <= span[1])
    if len(chosen):
        rays, span = np.take(rays, chosen, axis=1), np.take(span, chosen, axis=1)
        found = np.empty(len(chosen))
        march = one_by_one.compiled()
        if march is None:
            in_lockstep(heights, rays, span, found)
        else:
            march(heights, *heights.shape, rays, span, len(chosen), found)
        ranges[chosen] = found
    return ranges


def _checked(origins: ArrayLike, directions: ArrayLike) -> tuple[Positions, Positions]:
    along = as_array(directions, np.float64, "directions")
    if along.ndim != 2 or along.shape[1] != 3:
        raise GeometryError(f"directions: expected the shape (N, 3), got {along.shape}")
    begins = as_array(origins, np.float64, "origins")
    if begins.shape not in ((3,), along.shape):
        expected = f"(3,) or {along.shape}"
        raise GeometryError(f"origins: expected the shape {expected}, got {begins.shape}")
    return np.broadcast_to(begins, along.shape), along


def _span(rays: Positions, size: tuple[int, int], highest: float, limit: float) -> Positions:
    """Return the ranges (2, N) between which beams may meet the surface; NaN if they cannot.

    That is where a beam is over or under the map and not above its highest point.
    """
    begin, end = np.zeros(rays.shape[1]), np.full(rays.shape[1], limit)
    valid: Mask = np.logical_and.reduce(np.isfinite(rays))
    limits = [(0.5, size[0] + 0.5), (0.5, size[1] + 0.5), (-np.inf, highest)]
    for (low, high), start, step in zip(limits, rays[:3], rays[3:], strict=True):
        first, last = (low - start) / step, (high - start) / step
        still = step == 0.0
        valid &= ~still | ((start >= low) & (start <= high))
        begin = np.fmax(begin, np.where(still, 0.0, np.minimum(first, last)))
        end = np.fmin(end, np.where(still, np.inf, np.maximum(first, last)))
    return np.stack([np.where(valid, begin, np.nan), end])
