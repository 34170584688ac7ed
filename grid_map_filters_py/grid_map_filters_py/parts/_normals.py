# SPDX-License-Identifier: BSD-3-Clause
"""Computes surface normals of a layer, and deviations from fitted planes.

The functions have these arguments in common:

    layer: (rows, cols) heights [m] in map order; unknown heights are not finite.
    offset: typical height [m].
    radius: radius of the disc [m].
    resolution: side of a cell [m].

Normals are three (rows, cols) arrays with the x, y and z components of unit vectors.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer, slices

from ._disc import Disc, need_neighbors, typical_value

Field = npt.NDArray[np.float64]
Fields = tuple[Field, ...]

_SMALLEST_SPREAD = 1e-8
"""Points define a plane if their variance across the main direction exceeds this value [m^2]."""

_SMALLEST_GAP = 0.03
"""Product of relative eigenvalue gaps below which `_smallest_eigenvectors` is imprecise."""

_SMALLEST_Z = 0.01
"""z component of the normal below which `_smallest_eigenvectors` is imprecise."""

_PIECE = 2**14  # number of cells whose normals are computed at once, to fit the cache


def normals_of_blocks(layer: Layer, radius: float, resolution: float) -> Callable[[Layer], Fields]:
    """Return `area_normals` for blocks of a layer, or `raster_normals` if the radius is 0."""
    if not radius:
        return partial(raster_normals, resolution=resolution)
    need_neighbors(radius, resolution)
    offset = typical_value(layer)
    return partial(area_normals, offset=offset, radius=radius, resolution=resolution)


def area_normals(layer: Layer, offset: float, radius: float, resolution: float) -> Fields:
    """Return the normals of least-squares planes through the points in a disc around each cell.

    A normal is the eigenvector for the smallest eigenvalue of the covariance matrix of the points.
    If there are fewer than three points, or they are on a line, the normal is the z axis. Normals
    are NaN where the layer is not finite.
    """
    normals = tuple(np.empty(layer.shape, order="F") for _ in "xyz")
    for part, found, _, _ in _planes(layer, offset, Disc(radius, resolution, layer.shape)):
        for normal, values in zip(normals, found, strict=True):
            normal[:, part] = values
    return normals


def raster_normals(layer: Layer, resolution: float) -> Fields:
    """Return the normals computed from slopes between neighboring cells.

    The slope along an axis is the central difference of the two neighbors, or a one-sided
    difference if one of them is unknown. Normals are NaN at the layer border and where a slope is
    unknown.
    """
    heights = np.where(np.isfinite(layer), layer, np.nan).astype(np.float64)
    # Indices increase towards -x and -y, so the slopes are -dz/dx and -dz/dy.
    minus_x = _slope(heights[:, 1:-1], resolution)
    minus_y = _slope(heights[1:-1].T, resolution).T
    z = 1.0 / np.sqrt(minus_x * minus_x + minus_y * minus_y + 1.0)
    normals = tuple(np.full(layer.shape, np.nan, order="F") for _ in "xyz")
    for normal, values in zip(normals, (minus_x * z, minus_y * z, z), strict=True):
        normal[1:-1, 1:-1] = values
    return normals


def _slope(heights: Field, resolution: float) -> Field:
    """Return the slope along axis 0 in all rows except the first and the last."""
    behind, center, ahead = heights[:-2], heights[1:-1], heights[2:]
    slope = (ahead - behind) * (0.5 / resolution)
    one_sided = np.where(np.isnan(ahead), center - behind, ahead - center) / resolution
    return np.where(np.isnan(slope), one_sided, slope)


def plane_deviations(layer: Layer, offset: float, radius: float, resolution: float) -> Field:
    """Return the standard deviation [m] of the points in each disc from their fitted plane.

    The planes are those of `area_normals`. The denominator of the variance is n - 1. The result is
    NaN where the layer is not finite or the disc contains only one point.
    """
    deviations = np.empty(layer.shape, order="F")
    disc = Disc(radius, resolution, layer.shape)
    for part, (x, y, z), (xx, xy, xz, yy, yz, zz), count in _planes(layer, offset, disc):
        with np.errstate(invalid="ignore", divide="ignore"):
            mixed = x * y * xy + x * z * xz + y * z * yz
            variance = x * x * xx + y * y * yy + z * z * zz + 2.0 * mixed
            variance /= count * (count - 1.0)
            deviations[:, part] = resolution * np.sqrt(np.maximum(variance, 0.0))
    return deviations


def _planes(
    layer: Layer, offset: float, disc: Disc
) -> Iterator[tuple[slice, Fields, Fields, Field]]:
    """Fit least-squares planes to the points in the discs.

    Yields:
        part: slice of columns to which the following values belong.
        normals: unit vectors; NaN where the layer is not finite.
        covariances: elements xx, xy, xz, yy, yz, zz of the covariance matrices [cells^2], times the
            square of `count`.
        count: number of points.
    """
    known, sums = _sums(layer, offset, disc)
    for part in slices(layer.shape[1], _PIECE // len(layer)):
        count, x, y, z, *products = (field[:, part].astype(np.float64) for field in sums)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for product, (one, other) in zip(
                products, combinations_with_replacement((x, y, z), 2), strict=True
            ):
                product *= count
                product -= one * other
            spread = _SMALLEST_SPREAD / disc.resolution**2 * count * count
            unknown = ~known[:, part]
            normals = _normals(tuple(products), spread, unknown | (count < 3))
        for normal in normals:
            normal[unknown] = np.nan
        yield part, normals, tuple(products), count


def _sums(
    layer: Layer, offset: float, disc: Disc
) -> tuple[npt.NDArray[np.bool_], tuple[npt.NDArray[Any], ...]]:
    """Return a mask of the finite cells, and sums over the points in the discs.

    The summed terms are 1, x, y, z, xx, xy, xz, yy, yz and zz, with x, y and z in cells.
    """
    known, heights = disc.padded(layer, offset)
    # x and y are index offsets, which increase towards -x and -y. Heights are also negated: with
    # all three axes reversed, the covariances do not change.
    heights *= -1.0 / disc.resolution
    z, xz = _moments(disc, heights, 1, (0, 1))
    (yz,) = _moments(disc, heights, 1, (0,), along=True)
    (zz,) = _moments(disc, heights * heights, 1, (0,))
    # The smallest integer type that can hold the moments of a disc is fastest.
    largest = np.count_nonzero(disc.kernel) * max(disc.reach) ** 2
    one = known.astype(np.min_scalar_type(-largest - 1))
    (x, xx), (y, yy) = (_moments(disc, one, axis, (1, 2)) for axis in (1, 0))
    (xy,) = _moments(disc, one, 0, (1,), along=True)
    return known[disc.inner], (disc.counts(known), x, y, z, xx, xy, xz, yy, yz, zz)


def _normals(covariances: Fields, spread: Field, ignored: npt.NDArray[np.bool_]) -> Fields:
    """Return unit normals of fitted planes; the z axis where no plane can be fitted.

    The points are on a line if the second eigenvalue of the covariance matrix is at most `spread`.
    Cells in the mask `ignored` also get the z axis.
    """
    *normals, is_exact = _smallest_eigenvectors(*covariances)
    xx, xy, _, yy, _, _ = covariances
    # The second eigenvalue is at least the smaller eigenvalue of the horizontal 2 x 2 part. This
    # eigenvalue exceeds `spread` if (xx - spread, xy; xy, yy - spread) has a positive diagonal and
    # a positive determinant.
    is_exact &= (xx > spread) & ((xx - spread) * (yy - spread) > xy * xy)
    # Calling LAPACK is slow even for an empty array.
    if (doubtful := ~(is_exact | ignored)).any():
        places = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
        full = np.stack([field[doubtful] for field in covariances], axis=1)[:, places]
        values, vectors = np.linalg.eigh(full)
        upwards = vectors[:, :, 0] * np.copysign(1.0, vectors[:, 2, :1])
        spans_plane = values[:, 1] > spread[doubtful]
        exact = np.where(spans_plane[:, None], upwards, (0.0, 0.0, 1.0))
        for normal, components in zip(normals, exact.T, strict=True):
            normal[doubtful] = components
    for normal, upright in zip(normals, (0.0, 0.0, 1.0), strict=True):
        normal[ignored] = upright
    return tuple(normals)


def _moments(
    disc: Disc,
    values: npt.NDArray[Any],
    axis: int,
    orders: Sequence[int],
    *,
    along: bool = False,
) -> list[npt.NDArray[Any]]:
    """For each order, return the sums of value * distance^order over the disc around every cell.

    Args:
        values: padded values.
        axis: array axis along which lines of cells run. Distances are measured across the lines.
        orders: exponents of the distance, from 0 to 2.
        along: also multiply each value by its signed distance from the middle of the line.
    """
    totals = [disc.totals(values.dtype) for _ in orders]
    for distance, ahead, behind in disc.sums_of_lines(values, axis, moments=along):
        for (_, flat), order in zip(totals, orders, strict=True):
            if order == 0:
                flat += ahead
                if distance:
                    flat += behind
            elif distance:
                both = ahead - behind if order == 1 else ahead + behind
                both *= distance**order
                flat += both
    return [total for total, _ in totals]


def _smallest_eigenvectors(
    xx: Field, xy: Field, xz: Field, yy: Field, yz: Field, zz: Field
) -> tuple[Field, Field, Field, npt.NDArray[np.bool_]]:
    """Return unit eigenvectors for the smallest eigenvalues of symmetric 3 x 3 matrices.

    Eigenvalues are the trigonometric roots of the characteristic polynomial (O. K. Smith, 1961).
    The eigenvector is the last column of the adjugate of (matrix - smallest eigenvalue * identity).

    Returns:
        x, y and z components, and a mask of the precise eigenvectors. An eigenvector is imprecise
        at a vertical wall, or if two eigenvalues are close to each other.
    """
    mean = (xx + yy + zz) * (1.0 / 3.0)
    a, b, c = xx - mean, yy - mean, zz - mean
    xy2, xz2, yz2 = xy * xy, xz * xz, yz * yz
    # The diagonal a, b, c has the sum 0, so a^2 + b^2 + c^2 equals 2 * (b * b - a * c).
    square = (b * b - a * c + xy2 + xz2 + yz2) * (1.0 / 3.0)
    radius = np.sqrt(square)
    determinant = (b * c - yz2) * a - xz2 * b - xy2 * c + xy * xz * yz * 2.0
    cosine = determinant / (square * radius * 2.0)
    # Find the smallest t with 4 t^3 - 3 t = cosine. The root is computed in single precision for
    # speed, and refined by one Newton step. This suffices unless the next root is close.
    angle = np.arccos(np.clip(cosine.astype(np.float32), -1.0, 1.0))
    root = np.cos((angle + np.float32(2.0 * np.pi)) * np.float32(1.0 / 3.0)).astype(np.float64)
    squared = root * root
    gap = squared * 12.0 - 3.0
    smallest = (squared * root * 8.0 + cosine) / gap * radius * 2.0 + mean
    a, b, c = xx - smallest, yy - smallest, zz - smallest
    x, y, z = xy * yz - xz * b, xy * xz - yz * a, a * b - xy2
    # The trace of the adjugate is the factor of the outer product. If the last column is much
    # shorter, rounding errors dominate it.
    factor = (a + b) * c - xz2 - yz2 + z
    length = np.sqrt(x * x + y * y + z * z)
    is_exact = (gap > _SMALLEST_GAP) & (length > _SMALLEST_Z * factor)
    for component in (x, y, z):
        component /= length
    return x, y, z, is_exact
