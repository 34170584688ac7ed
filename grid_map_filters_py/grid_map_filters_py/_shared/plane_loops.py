# SPDX-License-Identifier: BSD-3-Clause
"""Compiled loops for normals of planes: sums over discs, eigenvectors of symmetric matrices.

`normals.py` has the same arithmetic for NumPy, which passes through memory for each operation, and
says where it comes from. Both give the same bits: operations have the same order.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._loops import loop

SMALLEST_GAP = 0.03
"""Product of the relative gaps between eigenvalues; below this the formula loses digits."""

SMALLEST_Z = 0.01
"""z component of a normal; below this the formula loses digits."""

_FEWEST = 3
"""Points that define a plane."""

_THIRD = 1.0 / 3.0
_NAN = float("nan")

_BLOCK = 256
"""Cells that a compiled loop handles at a time.

Copies of them are rows of one small array. In arrays of their own the compiler would have to expect
that they overlap, and could not use vector units.
"""

_ROWS = 12
"""Rows of that array."""


def work_memory() -> npt.NDArray[np.float64]:
    """Return memory that the loops need while they run."""
    return np.empty(_ROWS * _BLOCK)


def _load(work: Any, row: int, values: Any, begin: int, count: int) -> None:
    for i in range(count):
        work[row * _BLOCK + i] = values[begin + i]


def _load_moments(work: Any, moments: Any, others: Any, begin: int, count: int) -> None:
    _load(work, 0, moments[0], begin, count)
    _load(work, 1, moments[1], begin, count)
    _load(work, 2, moments[2], begin, count)
    _load(work, 3, moments[3], begin, count)
    _load(work, 4, moments[4], begin, count)
    _load(work, 5, moments[5], begin, count)
    _load(work, 6, others[0], begin, count)
    _load(work, 7, others[1], begin, count)
    _load(work, 8, others[2], begin, count)
    _load(work, 9, others[3], begin, count)


def _store(work: Any, row: int, values: Any, begin: int, count: int) -> None:
    for i in range(count):
        values[begin + i] = work[row * _BLOCK + i]


# The compiler uses vector units in loops of few arrays.


def _begin(lines: Any, heights: Any, middle: int, length: int, sums: Any, discs: Any) -> None:
    """Begin lines of one cell, and sums of 0 over the discs."""
    sum_line, moment_line, square_line = lines
    for i in range(length):
        sum_line[i], moment_line[i] = heights[middle + i], 0.0
    for i in range(length):
        square_line[i] = sum_line[i] * sum_line[i]
    start, count = discs
    for total in sums:
        for i in range(start, start + count):
            total[i] = 0.0


def _lengthen(lines: Any, heights: Any, middle: int, length: int, stride: int, widths: Any) -> None:
    """Add cells to both ends of lines, so that their half widths grow."""
    sum_line, moment_line, square_line = lines
    before, after = widths
    for width in range(before + 1, after + 1):
        ahead, behind = middle + width * stride, middle - width * stride
        for i in range(length):
            sum_line[i] = sum_line[i] + heights[ahead + i] + heights[behind + i]
        for i in range(length):
            moment_line[i] += (heights[ahead + i] - heights[behind + i]) * float(width)
        for i in range(length):
            one, other = heights[ahead + i], heights[behind + i]
            square_line[i] = square_line[i] + one * one + other * other


def _add_pairs(sums: Any, lines: Any, discs: Any, rows: int, distance: int) -> None:
    """Add the lines at a distance on both sides of the centers of discs."""
    start, count = discs
    of_heights, by_row, by_column, of_squares = sums
    sum_line, moment_line, square_line = lines
    ahead, behind = rows + distance, rows - distance
    for i in range(count):
        of_heights[start + i] += sum_line[ahead + i] + sum_line[behind + i]
    for i in range(count):
        by_row[start + i] += (sum_line[ahead + i] - sum_line[behind + i]) * float(distance)
    for i in range(count):
        by_column[start + i] += moment_line[ahead + i] + moment_line[behind + i]
    for i in range(count):
        of_squares[start + i] += square_line[ahead + i] + square_line[behind + i]


def _add_middles(sums: Any, lines: Any, discs: Any, rows: int) -> None:
    """Add the lines through the centers of discs."""
    start, count = discs
    of_heights, _, by_column, of_squares = sums
    sum_line, moment_line, square_line = lines
    for i in range(count):
        of_heights[start + i] += sum_line[rows + i]
    for i in range(count):
        by_column[start + i] += moment_line[rows + i]
    for i in range(count):
        of_squares[start + i] += square_line[rows + i]


@loop(
    "float64*",
    ("int64", 2),
    ("int64", 2),
    "int64*",
    ("float64*", 4),
    ("float64*", 3),
)
def sum_heights(heights: Any, reach: Any, size: Any, widths: Any, sums: Any, lines: Any) -> None:
    """Write the sums over discs of height, height times row, height times column, and squares.

    Args:
        heights: flat, with the margin of a `Tile`.
        reach: rows and columns from the center of a disc to its rim.
        size: number of columns of discs, and step from one to the next.
        widths: half widths of the lines of a disc along columns.
        sums: four arrays for the sums.
        lines: memory for the sums over lines of a column of discs and its margin.
    """
    (rows, columns), (count, stride) = reach, size
    length = stride + 2 * rows
    for column in range(count):
        discs, middle = (column * stride, stride), (column + columns) * stride
        _begin(lines, heights, middle, length, sums, discs)
        width = 0
        for distance in range(rows, 0, -1):
            # Lines get longer towards the centers.
            half = (width, widths[distance])
            _lengthen(lines, heights, middle, length, stride, half)
            _add_pairs(sums, lines, discs, rows, distance)
            width = widths[distance]
        _lengthen(lines, heights, middle, length, stride, (width, widths[0]))
        _add_middles(sums, lines, discs, rows)


@loop(("float64*", 6), ("float64*", 4), ("float64*", 3), "int64", "float64*")
def to_cosines(moments: Any, sums: Any, spectrum: Any, size: int, work: Any) -> None:
    """Replace second moments by covariances; write mean, radius and cosine of the eigenvalues.

    Takes 6 and 4 arrays as `normals.py` has them, 3 for the results, and `work_memory`.
    """
    for begin in range(0, size, _BLOCK):
        count = min(_BLOCK, size - begin)
        _load_moments(work, moments, sums, begin, count)
        for i in range(count):
            number = work[6 * _BLOCK + i]
            sum_x, sum_y, sum_z = work[7 * _BLOCK + i], work[8 * _BLOCK + i], work[9 * _BLOCK + i]
            xx = work[i] * number - sum_x * sum_x
            xy = work[_BLOCK + i] * number - sum_x * sum_y
            xz = work[2 * _BLOCK + i] * number - sum_x * sum_z
            yy = work[3 * _BLOCK + i] * number - sum_y * sum_y
            yz = work[4 * _BLOCK + i] * number - sum_y * sum_z
            zz = work[5 * _BLOCK + i] * number - sum_z * sum_z
            mean = (xx + yy + zz) * _THIRD
            a, b, c = xx - mean, yy - mean, zz - mean
            xy2, xz2, yz2 = xy * xy, xz * xz, yz * yz
            square = (b * b - a * c + xy2 + xz2 + yz2) * _THIRD
            radius = np.sqrt(square)
            determinant = (b * c - yz2) * a - xz2 * b - xy2 * c + xy * xz * yz * 2.0
            work[i] = xx
            work[_BLOCK + i] = xy
            work[2 * _BLOCK + i] = xz
            work[3 * _BLOCK + i] = yy
            work[4 * _BLOCK + i] = yz
            work[5 * _BLOCK + i] = zz
            work[6 * _BLOCK + i] = mean
            work[7 * _BLOCK + i] = radius
            work[8 * _BLOCK + i] = determinant / (square * radius * 2.0)
        _store(work, 0, moments[0], begin, count)
        _store(work, 1, moments[1], begin, count)
        _store(work, 2, moments[2], begin, count)
        _store(work, 3, moments[3], begin, count)
        _store(work, 4, moments[4], begin, count)
        _store(work, 5, moments[5], begin, count)
        _store(work, 6, spectrum[0], begin, count)
        _store(work, 7, spectrum[1], begin, count)
        _store(work, 8, spectrum[2], begin, count)


@loop(
    ("float64*", 6),
    ("float64*", 4),
    "float32*",
    "uint8*",
    "uint8*",
    "float64",
    ("float64*", 3),
    "int64",
    "float64*",
)
def to_normals(
    moments: Any,
    fields: Any,
    roots: Any,
    known: Any,
    doubtful: Any,
    smallest_spread: float,
    vectors: Any,
    size: int,
    work: Any,
) -> None:
    """Write the components of normals, and which of them are doubtful.

    Takes the covariances; number of points, mean, radius and cosine; roots in single precision.
    """
    for begin in range(0, size, _BLOCK):
        count = min(_BLOCK, size - begin)
        _load_moments(work, moments, fields, begin, count)
        _load(work, 10, roots, begin, count)
        _load(work, 11, known, begin, count)
        for i in range(count):
            xx, xy, xz = work[i], work[_BLOCK + i], work[2 * _BLOCK + i]
            yy, yz, zz = work[3 * _BLOCK + i], work[4 * _BLOCK + i], work[5 * _BLOCK + i]
            number, mean = work[6 * _BLOCK + i], work[7 * _BLOCK + i]
            radius, cosine = work[8 * _BLOCK + i], work[9 * _BLOCK + i]
            root = work[10 * _BLOCK + i]
            slope = root * root
            gap = slope * 12.0 - 3.0
            smallest = (root * slope * 8.0 + cosine) / gap * radius * 2.0 + mean
            a, b, c = xx - smallest, yy - smallest, zz - smallest
            x, y, z = xy * yz - xz * b, xy * xz - yz * a, a * b - xy * xy
            factor = (a + b) * c - xz * xz - yz * yz + z
            scale = np.sqrt(x * x + y * y + z * z)
            inverse = 1.0 / scale
            spread = smallest_spread * number * number
            is_exact = (gap > SMALLEST_GAP) & (scale > SMALLEST_Z * factor)
            is_exact &= (xx > spread) & ((xx - spread) * (yy - spread) > xy * xy)
            is_lone, is_known = number < _FEWEST, work[11 * _BLOCK + i] != 0.0
            work[i] = (0.0 if is_lone else x * inverse) if is_known else _NAN
            work[_BLOCK + i] = (0.0 if is_lone else y * inverse) if is_known else _NAN
            work[2 * _BLOCK + i] = (1.0 if is_lone else z * inverse) if is_known else _NAN
            work[3 * _BLOCK + i] = 0.0 if is_exact | is_lone | (not is_known) else 1.0
        _store(work, 0, vectors[0], begin, count)
        _store(work, 1, vectors[1], begin, count)
        _store(work, 2, vectors[2], begin, count)
        for i in range(count):
            doubtful[begin + i] = np.uint8(work[3 * _BLOCK + i])
