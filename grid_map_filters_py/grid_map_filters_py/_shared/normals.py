# SPDX-License-Identifier: BSD-3-Clause
"""Surface normals of a layer.

A layer is (rows, cols) heights [m] in map order, not finite where unknown; `offset` is its typical
value. The radius of the discs and the resolution, which is the side of a cell, are in m. Normals
are the x, y and z components (rows, cols) of unit vectors; those of planes are NaN where the layer
is not finite.
"""

from collections.abc import Callable, Sequence
from itertools import combinations_with_replacement

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer, Mask
from grid_map_core_py._loops import Compiled

from ..parts._disc import Disc, Flat, Tile, tiles
from ..parts._side_by_side import side_by_side
from .plane_loops import (
    SMALLEST_GAP,
    SMALLEST_Z,
    sum_heights,
    to_cosines,
    to_normals,
    work_memory,
)

Normals = tuple[Layer, ...]
Field = npt.NDArray[np.float64]
Components = tuple[Field, ...]
Symmetric = tuple[Field, ...]
"""Symmetric 3 x 3 matrices, by arrays of their elements xx, xy, xz, yy, yz, zz."""

_SMALLEST_SPREAD = 1e-8
"""Variance [m^2] of points across a line; below this they define no plane."""


def prepare_normals() -> tuple[Compiled, ...]:
    """Return the compiled loops, from disk or compiled now; none where there is no compiler."""
    loops = tuple(each.compiled() for each in (sum_heights, to_cosines, to_normals))
    return tuple(filter(None, loops)) if all(loops) else ()


def area_normals(layer: Layer, offset: float, radius: float, resolution: float) -> Normals:
    """Return the normals of least-squares planes through the points in a disc around each cell.

    The normal is the eigenvector of the smallest eigenvalue of the covariance of the points. Where
    fewer than three points are finite, or they are on a line, it is the z axis.
    """
    disc = Disc(radius, resolution, layer.shape)
    return _by_tiles(disc, 3, lambda tile: _planes(layer, offset, tile)[0])


def raster_normals(layer: Layer, resolution: float) -> Normals:
    """Return the normals from the slopes between neighboring cells.

    Slopes are central differences, also across an unknown cell, and one-sided beside one. Normals
    are NaN at the border of the map, and where a slope has no two finite cells.
    """
    if min(layer.shape) <= 2:
        return tuple(np.full_like(layer, np.nan) for _ in "xyz")
    disc = Disc(resolution, resolution, layer.shape)
    normals = _by_tiles(disc, 3, lambda tile: _raster_normals(layer, tile))
    for normal in normals:
        normal[[0, -1], :] = np.nan
        normal[:, [0, -1]] = np.nan
    return normals


def plane_deviations(layer: Layer, offset: float, radius: float, resolution: float) -> Layer:
    """Return the standard deviation [m] of the points in a disc from the plane of `area_normals`.

    It is that of a sample (n - 1 in the denominator); NaN also where the disc has one point.
    """
    disc = Disc(radius, resolution, layer.shape)
    return _by_tiles(
        disc, 1, lambda tile: (resolution * _deviations(*_planes(layer, offset, tile)),)
    )[0]


def _by_tiles(disc: Disc, count: int, values_of: Callable[[Tile], Components]) -> Normals:
    """Return `count` layers; `values_of` gives their flat values in a tile."""
    layers = tuple(np.empty(disc.size, np.float32, order="F") for _ in range(count))
    # About twenty arrays of a tile fit into the cache.
    side = max(128, min(256, max(disc.size) // 5))

    def compute(tile: Tile) -> None:
        for layer, values in zip(layers, values_of(tile), strict=True):
            # Differences of very large floats may overflow.
            with np.errstate(over="ignore"):
                layer[tile.rows, tile.columns] = tile.cells(values)

    side_by_side(compute, tiles(disc, side))
    return layers


def _raster_normals(layer: Layer, tile: Tile) -> Components:
    """Return the flat components for a tile; cells beyond the border are unknown."""
    heights = tile.cut(layer, np.float64)
    np.copyto(heights, np.nan, where=np.isinf(heights))
    # Rows run towards -x and columns towards -y: these are -dz/dx and -dz/dy.
    minus_x = _slope(heights, tile, rows=1)
    minus_y = _slope(heights, tile, columns=1)
    z = minus_x * minus_x
    z += minus_y * minus_y
    z += 1.0
    np.sqrt(z, out=z)
    np.divide(1.0, z, out=z)
    minus_x *= z
    minus_y *= z
    return minus_x, minus_y, z


def _slope(heights: Flat, tile: Tile, rows: int = 0, columns: int = 0) -> Flat:
    """Return the slope towards the neighbor at a distance in rows and columns."""
    behind, ahead = (tile.neighbors(heights, s * rows, s * columns) for s in (-1, 1))
    slope = ahead - behind
    slope *= 0.5 / tile.disc.resolution
    # Only the few cells beside a hole are computed again.
    places = np.flatnonzero(np.isnan(slope))
    center = tile.neighbors(heights)[places]
    from_behind, to_ahead = center - behind[places], ahead[places] - center
    slope[places] = np.where(np.isnan(to_ahead), from_behind, to_ahead) / tile.disc.resolution
    return slope


def _planes(layer: Layer, offset: float, tile: Tile) -> tuple[Components, Symmetric, Field]:
    """Return least-squares planes through the points in the discs of a tile, as flat arrays.

    Returns:
        normals: unit vectors, NaN where the layer is not finite.
        covariances: covariances of the points, times the square of their number [cells^2].
        count: number of points.
    """
    known, heights = tile.finite(layer, offset)
    # In cells, all coordinates but the heights are integers. Rows run towards -x and columns
    # towards -y: with negative heights all signs are right.
    heights *= -1.0 / tile.disc.resolution
    moments, sums = _moments(known, heights, tile)
    smallest_spread = _SMALLEST_SPREAD / tile.disc.resolution**2
    normals = _normals_of(moments, sums, tile.neighbors(known), smallest_spread)
    return normals, moments, sums[0]


def _moments(known: Flat, z: Flat, tile: Tile) -> tuple[Symmetric, Components]:
    """Return the second moments of the points; their number, and the sums of their coordinates.

    Coordinates are in cells from the center of the disc, along rows, along columns and downwards.
    """
    sum_z, xz, yz, zz = (_height_moments_by_loop if prepare_normals() else _height_moments)(z, tile)
    count, sum_x, sum_y, xx, xy, yy = _point_moments(known, tile)
    return (xx, xy, xz, yy, yz, zz), (count, sum_x, sum_y, sum_z)


def _height_moments(z: Flat, tile: Tile) -> Components:
    """Return the sums of z, of its products with rows and columns, and of its squares."""
    sum_z, xz = _moments_across(tile, z, 1, (0, 1))
    (yz,) = _moments_across(tile, z, 1, (0,), moments=True)
    (zz,) = _moments_across(tile, z * z, 1, (0,))
    return sum_z, xz, yz, zz


def _height_moments_by_loop(z: Flat, tile: Tile) -> Components:
    """Do what `_height_moments` does, to the bit, with a compiled loop."""
    disc, (_, stride) = tile.disc, tile.strides
    sums, lines = np.empty((4, tile.count)), np.empty((3, stride + 2 * disc.reach[0]))
    size = tile.count // stride, stride
    prepare_normals()[0](z, disc.reach, size, disc.half_widths[1], tuple(sums), tuple(lines))
    return tuple(sums)


def _point_moments(known: Flat, tile: Tile) -> Components:
    """Return the number of points, the sums of rows and columns, and of their products."""
    disc, (_, stride) = tile.disc, tile.strides
    # The last cells only fill up the array.
    if known[: known.size // stride * stride].all():
        # Of whole discs, whose moments of odd order are 0.
        x, y = disc.offsets
        values = [np.sum(disc.kernel * factor) for factor in (1.0, 0.0, 0.0, x * x, 0.0, y * y)]
        return tuple(np.full(tile.count, value) for value in values)
    # The smallest integer type that holds the moments of a whole disc is the fastest.
    largest = np.count_nonzero(disc.kernel) * max(disc.reach) ** 2
    one = known.astype(np.min_scalar_type(-largest - 1))
    sum_x, xx = _moments_across(tile, one, 1, (1, 2))
    sum_y, yy = _moments_across(tile, one, 0, (1, 2))
    (xy,) = _moments_across(tile, one, 0, (1,), moments=True)
    fields = tile.counts(known), sum_x, sum_y, xx, xy, yy
    return tuple(field.astype(np.float64, copy=False) for field in fields)


def _moments_across(
    tile: Tile, values: Flat, axis: int, orders: Sequence[int], *, moments: bool = False
) -> list[Flat]:
    """Return the moments of values about the lines along `axis`: sums times powers of the distance.

    Args:
        tile: tile of cells whose discs are summed.
        values: flat.
        axis: direction of the lines; the distance is along the other axis.
        orders: the powers, from 0 to 2.
        moments: sum up the values times their distance along the lines.
    """
    totals = [np.zeros(tile.count, values.dtype) for _ in orders]
    for distance, ahead, behind in tile.lines(values, axis, moments=moments):
        for total, order in zip(totals, orders, strict=True):
            if distance:
                both = ahead - behind if order == 1 else ahead + behind
                if distance**order != 1:
                    both *= distance**order
                total += both
            elif order == 0:
                total += ahead
    return totals


def _normals_of(
    moments: Symmetric, sums: Components, known: Mask, smallest_spread: float
) -> Components:
    """Return unit vectors, NaN where not `known`.

    Args:
        moments: second moments of the points in the discs; they become their covariances, times
            the square of their number.
        sums: number of points, and sums of their coordinates.
        known: cells that get a normal.
        smallest_spread: smallest variance of points that define a plane [cells^2].
    """
    fit = _planes_by_loops if prepare_normals() else _planes_by_numpy
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        vectors, doubtful = fit(moments, sums, known, smallest_spread)
    places = np.flatnonzero(doubtful)
    # Calling LAPACK is slow even for an empty array.
    if places.size:
        xx, xy, xz, yy, yz, zz = (field[places] for field in moments)
        full = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), 2, 0)
        spread = smallest_spread * sums[0][places] * sums[0][places]
        exact = _eigenvectors_or_upright(full, spread)
        for component, values in zip(vectors, exact, strict=True):
            component[places] = values
    return vectors


def _planes_by_loops(
    moments: Symmetric, sums: Components, known: Mask, smallest_spread: float
) -> tuple[Components, Mask]:
    """Do what `_planes_by_numpy` does, to the bit, with compiled loops."""
    size, work = known.size, work_memory()
    mean, radius, cosine, x, y, z = np.empty((6, size))
    doubtful = np.empty(size, np.bool_)
    _, for_cosines, for_normals = prepare_normals()
    for_cosines(moments, sums, (mean, radius, cosine), size, work)
    fields, roots = (sums[0], mean, radius, cosine), _first_roots(cosine)
    flags = known.view(np.uint8), doubtful.view(np.uint8)
    for_normals(moments, fields, roots, *flags, smallest_spread, (x, y, z), size, work)
    return (x, y, z), doubtful


def _planes_by_numpy(
    moments: Symmetric, sums: Components, known: Mask, smallest_spread: float
) -> tuple[Components, Mask]:
    """Return normals, and a mask of known ones that lost digits; see `_normals_of`."""
    count = sums[0]
    for element, (first, second) in zip(
        moments, combinations_with_replacement(sums[1:], 2), strict=True
    ):
        element *= count
        element -= first * second
    spread = smallest_spread * count * count
    vectors, doubtful = _smallest_eigenvectors(moments)
    xx, xy, _, yy, _, _ = moments
    # The second eigenvalue is at least the smaller one of the horizontal 2 x 2 part. That exceeds
    # the spread where diagonal and determinant of xx - spread, xy, yy - spread are positive.
    doubtful |= (xx <= spread) | ((xx - spread) * (yy - spread) <= xy * xy)
    lone = count < 3
    doubtful &= known & ~lone
    for component, upright in zip(vectors, (0.0, 0.0, 1.0), strict=True):
        component[lone] = upright
        component[~known] = np.nan
    return vectors, doubtful


def _deviations(normals: Components, covariances: Symmetric, count: Field) -> Field:
    """Return the standard deviations along the normals [cells]."""
    variance = np.zeros_like(count)
    pairs = combinations_with_replacement(normals, 2)
    for (one, other), element in zip(pairs, covariances, strict=True):
        product = one * other
        product *= element
        variance += product
        if one is not other:
            variance += product
    with np.errstate(invalid="ignore", divide="ignore"):
        variance /= count * (count - 1.0)
        np.maximum(variance, 0.0, out=variance)
    return np.sqrt(variance, out=variance)


def _eigenvectors_or_upright(matrices: Field, spread: Field) -> Field:
    """Return (3, N) eigenvectors of the smallest eigenvalue; the z axis for points on a line."""
    values, vectors = np.linalg.eigh(matrices)
    upwards = np.copysign(1.0, vectors[:, 2, :1])
    spans_plane = values[:, 1, None] > spread[:, None]
    return np.where(spans_plane, vectors[:, :, 0] * upwards, (0.0, 0.0, 1.0)).T


def _smallest_eigenvectors(matrices: Symmetric) -> tuple[Components, Mask]:
    """Return unit eigenvectors of the smallest eigenvalue of symmetric 3 x 3 matrices.

    The adjugate of a matrix minus its smallest eigenvalue is the eigenvector times itself, up to a
    factor. Its last column is taken.

    Returns:
        components: x, y and z.
        doubtful: mask of vectors that lost digits: of vertical walls and close eigenvalues.
    """
    xx, xy, xz, yy, yz, zz = matrices
    smallest, doubtful = _smallest_eigenvalues(matrices)
    a, b, c = xx - smallest, yy - smallest, zz - smallest
    x, y, z = xy * yz, xy * xz, a * b
    x -= xz * b
    y -= yz * a
    z -= xy * xy
    # The factor is the trace of the adjugate. Columns of rounding errors are short compared to it.
    factor = (a + b) * c
    factor -= xz * xz
    factor -= yz * yz
    factor += z
    scale = x * x
    scale += y * y
    scale += z * z
    np.sqrt(scale, out=scale)
    doubtful |= ~(scale > SMALLEST_Z * factor)
    np.divide(1.0, scale, out=scale)
    for component in (x, y, z):
        component *= scale
    return (x, y, z), doubtful


def _smallest_eigenvalues(matrices: Symmetric) -> tuple[Field, Mask]:
    """Return the smallest eigenvalues of symmetric 3 x 3 matrices, and a mask of inexact ones.

    They are the trigonometric roots of the characteristic polynomial (O. K. Smith, 1961).
    """
    xx, xy, xz, yy, yz, zz = matrices
    mean = xx + yy
    mean += zz
    mean *= 1.0 / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    xy2, xz2, yz2 = xy * xy, xz * xz, yz * yz
    # The diagonal a, b, c adds up to 0, hence its squares to twice b * b - a * c.
    square = b * b
    square -= a * c
    square += xy2
    square += xz2
    square += yz2
    square *= 1.0 / 3.0
    radius = np.sqrt(square)
    determinant = b * c
    determinant -= yz2
    determinant *= a
    determinant -= np.multiply(xz2, b, out=xz2)
    determinant -= np.multiply(xy2, c, out=xy2)
    product = xy * xz
    product *= yz
    product *= 2.0
    determinant += product
    square *= radius
    square *= 2.0
    determinant /= square
    roots, doubtful = _smallest_roots(determinant)
    roots *= radius
    roots *= 2.0
    roots += mean
    return roots, doubtful


def _smallest_roots(cosine: Field) -> tuple[Field, Mask]:
    """Return the smallest t with 4 t^3 - 3 t = cosine, which is cos((acos(cosine) + 2 pi) / 3).

    One step of Newton's method refines a root in single precision to double precision, unless the
    next root is close; that is several times as fast as cosines in double precision.

    Returns:
        t, and a mask of the inexact ones.
    """
    roots = _first_roots(cosine).astype(np.float64)
    slope = roots * roots
    roots *= slope
    roots *= 8.0
    roots += cosine
    slope *= 12.0
    slope -= 3.0
    roots /= slope
    return roots, ~(slope > SMALLEST_GAP)


def _first_roots(cosine: Field) -> npt.NDArray[np.float32]:
    """Return the roots of `_smallest_roots` in single precision."""
    angle = cosine.astype(np.float32)
    np.clip(angle, -1.0, 1.0, out=angle)
    np.arccos(angle, out=angle)
    angle += np.float32(2.0 * np.pi)
    angle *= np.float32(1.0 / 3.0)
    return np.asarray(np.cos(angle, out=angle))
