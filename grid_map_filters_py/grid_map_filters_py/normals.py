# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Surface normals of a layer."""

import numpy as np
import numpy.typing as npt

from grid_map_core_py.arrays import Layer, Mask

from .disc import Disc, Sums, centred, correlate

Normals = tuple[Layer, Layer, Layer]
Field = npt.NDArray[np.float64]

_SMALLEST_SPREAD = 1e-8
"""Variance [m^2] across a line of points below which they span no plane."""

_SMALLEST_GAP = 1e-6
"""Product of the relative gaps between eigenvalues below which the formula loses digits."""

_SMALLEST_SHARE = 1e-4
"""Square of the z component of a normal below which the formula loses digits."""


def area_normals(layer: Layer, radius: float, resolution: float) -> Normals:
    """Return the normals of the planes that fit best to the points in a disc around each cell.

    The normal is the eigenvector of the smallest eigenvalue of the covariance of the points. Where
    fewer than three points are finite, or they lie on a line, it is the z axis.

    Args:
        layer: (rows, cols) heights [m] in map order; not finite where unknown.
        radius: of the disc [m].
        resolution: side of a cell [m].

    Returns:
        x, y and z components (rows, cols) of unit vectors; NaN where the layer is not finite.
    """
    mask, heights, _ = centred(layer)
    count, covariance = _covariance(mask, heights, Disc(radius, resolution, layer.shape))
    with np.errstate(invalid="ignore", divide="ignore"):
        normals, spread = _smallest_eigenvectors(*covariance)
    flat = (count < 3) | ~(spread > _SMALLEST_SPREAD)
    return _store(normals, flat, mask)


def raster_normals(layer: Layer, resolution: float) -> Normals:
    """Return the normals from the slopes between neighbouring cells.

    Slopes are central differences, also across an unknown cell, and one-sided beside one.

    Args:
        layer: (rows, cols) heights [m] in map order; not finite where unknown.
        resolution: side of a cell [m].

    Returns:
        x, y and z components (rows, cols) of unit vectors; NaN in the cells at the border of the
        map and where a slope has no two finite cells.
    """
    heights = layer.astype(np.float64)
    heights[~np.isfinite(heights)] = np.nan
    centre = heights[1:-1, 1:-1]
    slope_x = _slope(heights[:-2, 1:-1], centre, heights[2:, 1:-1], resolution)
    slope_y = _slope(heights[1:-1, :-2], centre, heights[1:-1, 2:], resolution)
    length = np.sqrt(np.square(slope_x) + np.square(slope_y) + 1.0)
    normals = tuple(np.full(layer.shape, np.nan, np.float32, order="F") for _ in range(3))
    for normal, component in zip(normals, (-slope_x, -slope_y, 1.0), strict=True):
        normal[1:-1, 1:-1] = component / length
    return normals  # type: ignore[return-value]


def flip_towards(normals: Normals, axis: int) -> Normals:
    """Turn the normals so that their component along an axis (0, 1, 2) is not negative."""
    away = normals[axis] < 0
    for component in normals:
        np.negative(component, out=component, where=away)
    return normals


def _slope(ahead: Field, centre: Field, behind: Field, resolution: float) -> Field:
    """Return the rise along the axis that points from `behind` to `ahead`."""
    central = (ahead - behind) / (2 * resolution)
    forward, backward = (ahead - centre) / resolution, (centre - behind) / resolution
    one_sided = np.where(np.isnan(forward), backward, forward)
    return np.where(np.isnan(central), one_sided, central)


def _covariance(mask: Mask, z: Sums, disc: Disc) -> tuple[Sums, tuple[Field, ...]]:
    """Return how many points a disc has, and xx, xy, xz, yy, yz, zz of their covariance [m^2]."""
    known = np.asarray(mask, dtype=np.float64, order="F")
    kernel, (rows, columns) = disc.kernel, disc.offsets
    # Rows run towards -x and columns towards -y.
    x, y = -disc.resolution * rows * kernel, -disc.resolution * columns * kernel
    count = correlate(known, kernel)
    share = 1.0 / np.maximum(count, 1.0)
    mean_x, mean_y, mean_z = (
        correlate(values, weights) * share
        for values, weights in ((known, x), (known, y), (z, kernel))
    )
    xx, xy, yy = (correlate(known, weights) * share for weights in (x * x, x * y, y * y))
    xz, yz, zz = (
        correlate(values, weights) * share for values, weights in ((z, x), (z, y), (z * z, kernel))
    )
    return count, (
        xx - mean_x * mean_x,
        xy - mean_x * mean_y,
        xz - mean_x * mean_z,
        yy - mean_y * mean_y,
        yz - mean_y * mean_z,
        zz - mean_z * mean_z,
    )


def _smallest_eigenvectors(
    xx: Field, xy: Field, xz: Field, yy: Field, yz: Field, zz: Field
) -> tuple[tuple[Field, Field, Field], Field]:
    """Return unit eigenvectors of the smallest eigenvalue of symmetric 3 x 3 matrices.

    The adjugate of a matrix minus its smallest eigenvalue is the eigenvector times itself, up to a
    factor. Its last column is taken; the few matrices where that loses digits, those of vertical
    walls and of two eigenvalues close together, are left to LAPACK.

    Returns:
        The x, y and z components, and the second eigenvalue.
    """
    smallest, middle = _eigenvalues(xx, xy, xz, yy, yz, zz)
    a, b, c = xx - smallest, yy - smallest, zz - smallest
    x, y, z = xy * yz - xz * b, xy * xz - a * yz, a * b - xy * xy
    # The product of the distances to the other two eigenvalues, and the factor.
    gaps = (b * c - yz * yz) + (a * c - xz * xz) + z
    length = np.sqrt(x * x + y * y + z * z)
    vectors = np.stack([x, y, z]) / length
    weak = (gaps <= _SMALLEST_GAP * np.square(xx + yy + zz)) | (z <= _SMALLEST_SHARE * gaps)
    matrices = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[:, :, weak]
    vectors[:, weak] = np.linalg.eigh(np.moveaxis(matrices, 2, 0))[1][:, :, 0].T
    return (vectors[0], vectors[1], vectors[2]), middle


def _eigenvalues(
    xx: Field, xy: Field, xz: Field, yy: Field, yz: Field, zz: Field
) -> tuple[Field, Field]:
    """Return the smallest and the middle eigenvalue of symmetric 3 x 3 matrices.

    The smallest is a trigonometric root of the characteristic polynomial (O. K. Smith, 1961).
    """
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    off_diagonal = xy * xy + xz * xz + yz * yz
    radius = np.sqrt((a * a + b * b + c * c + 2.0 * off_diagonal) / 6.0)
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    angle = np.arccos(np.clip(determinant / (2.0 * radius**3), -1.0, 1.0)) / 3.0
    smallest = mean + 2.0 * radius * np.cos(angle + 2.0 * np.pi / 3.0)
    # The other two follow from their sum and their product.
    half_sum = 0.5 * (3.0 * mean - smallest)
    product = xx * yy + xx * zz + yy * zz - off_diagonal - 2.0 * smallest * half_sum
    middle = half_sum - np.sqrt(np.maximum(half_sum * half_sum - product, 0.0))
    return smallest, middle


def _store(normals: tuple[Field, Field, Field], flat: Mask, mask: Mask) -> Normals:
    """Return float32 layers with the z axis where `flat` and NaN where not `mask`."""
    layers = []
    for component, upwards in zip(normals, (0.0, 0.0, 1.0), strict=True):
        layer = np.asarray(component, dtype=np.float32, order="F")
        layer[flat] = upwards
        layer[~mask] = np.nan
        layers.append(layer)
    return layers[0], layers[1], layers[2]
