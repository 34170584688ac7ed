# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Intersection of a ray with a mesh, to find the point under the pointer."""

import numpy as np

from grid_map_core_py.arrays import Positions

from ..surface import Mesh


def hit(mesh: Mesh, start: Positions, direction: Positions) -> Positions | None:
    """Return the first point (3,) at which a ray hits a mesh [m, map frame], from either side.

    Source: Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, 1997.

    Args:
        mesh: the surface.
        start: (3,) start of the ray [m], map frame.
        direction: (3,) direction of the ray, of any length except zero.

    Returns:
        The point, or None if the ray hits nothing.
    """
    direction = np.asarray(direction, dtype=np.float64)
    direction = direction / np.linalg.norm(direction)
    corners = mesh.vertices.astype(np.float64)
    first, second, third = (corners[mesh.faces[:, k]] for k in range(3))
    side, other = second - first, third - first
    offset = np.asarray(start, dtype=np.float64) - mesh.origin - first
    normal = np.cross(direction, other)
    volume = np.einsum("ij,ij->i", side, normal)
    across = np.cross(offset, side)
    area = np.einsum("ij,ij->i", side, side)
    # Parallel triangles divide by zero; the mask below excludes them.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        u = np.einsum("ij,ij->i", offset, normal) / volume
        v = across @ direction / volume
        distance = np.einsum("ij,ij->i", other, across) / volume
        is_hit = (np.abs(volume) > 1e-12 * area) & (u >= 0) & (v >= 0) & (u + v <= 1)
        is_hit &= distance > 0
    if not is_hit.any():
        return None
    point: Positions = start + distance[is_hit].min() * direction
    return point
