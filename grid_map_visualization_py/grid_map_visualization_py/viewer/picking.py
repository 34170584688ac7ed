# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Cell under the pointer."""

import numpy as np

from grid_map_core_py.arrays import Positions

from ..surface import Mesh

_PARALLEL = 1e-12
"""Triangles that a ray sees at a smaller angle are seen edge on."""


def hit(mesh: Mesh, start: Positions, direction: Positions) -> Positions | None:
    """Return the first point (3,) of a mesh [m, map frame] that a ray meets, from either side.

    Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, 1997, for all triangles.

    Args:
        mesh: the surface.
        start: (3,) where the ray starts [m], map frame.
        direction: (3,) where it goes; of any length but zero.

    Returns:
        the point; None if the ray meets nothing.
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
    # Nothing that comes of a triangle seen edge on is used.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        u = np.einsum("ij,ij->i", offset, normal) / volume
        v = across @ direction / volume
        distance = np.einsum("ij,ij->i", other, across) / volume
        is_met = (np.abs(volume) > _PARALLEL * area) & (u >= 0) & (v >= 0) & (u + v <= 1)
        is_met &= distance > 0
    if not is_met.any():
        return None
    point: Positions = start + distance[is_met].min() * direction
    return point
