# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Voxel grid downsampling of point clouds."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays._checks import Positions, as_array
from ..errors import GeometryError
from ._point_layers import as_points


def downsample(points: ArrayLike, voxel_size: ArrayLike) -> Positions:
    """Return the mean of the points in each voxel that holds any.

    Args:
        points: (N, 3) or wider, x, y, z [m]; those that are not finite are left out.
        voxel_size: (3,) sides of a voxel [m].

    Returns:
        (M, 3) float64, voxel by voxel in growing x, then y, then z.

    Raises:
        GeometryError: a side is not positive and finite, or is too small for the extent of the
            points.
    """
    sides = as_array(voxel_size, np.float64, "voxel_size")
    if sides.shape != (3,) or not (np.isfinite(sides).all() and (sides > 0).all()):
        raise GeometryError(f"voxel_size: expected three positive numbers, got {voxel_size!r}")
    xyz = finite_points(points)
    if not len(xyz):
        return xyz
    first = np.floor(xyz.min(axis=0) / sides)
    counts = np.floor(xyz.max(axis=0) / sides) - first + 1
    with np.errstate(over="ignore"):
        voxel_count = counts.prod()
    if not voxel_count < 2.0**62:
        raise GeometryError(
            f"voxel_size: expected fewer than 2**62 voxels, got sides {tuple(sides.tolist())} m"
        )
    voxels = np.zeros(len(xyz), np.int64)
    for axis in range(3):
        voxels *= int(counts[axis])
        voxels += (np.floor(xyz[:, axis] / sides[axis]) - first[axis]).astype(np.int64)
    _, numbers = np.unique(voxels, return_inverse=True)
    sizes = np.bincount(numbers)
    # Relative to a point of the cloud, because sums of large coordinates lose precision.
    offsets = (xyz - xyz[0]).T
    means: Positions = np.column_stack([np.bincount(numbers, along) for along in offsets])
    means /= sizes[:, None]
    means += xyz[0]
    return means


def finite_points(points: ArrayLike) -> Positions:
    """Return x, y, z (N, 3) as float64 of the points with finite coordinates."""
    xyz: Positions = as_points(points)[:, :3].astype(np.float64)
    finite = np.isfinite(xyz).all(axis=1)
    return xyz if finite.all() else xyz[finite]
