# SPDX-License-Identifier: BSD-3-Clause
"""Compiled loop for standard deviations in windows; `_window_matrices.py` does it with NumPy."""

from typing import Any

from grid_map_core_py._loops import loop


def _is_finite(value: Any) -> Any:
    return value - value == 0.0


def _fold_column(
    source: Any, height: int, rows: int, start: int, count: Any, mean: Any, squares: Any
) -> None:
    for i in range(rows):
        count[start + i] = mean[start + i] = squares[start + i] = 0.0
    first = start // rows * (rows + height - 1)
    for row in range(first, first + height):
        for i in range(rows):
            is_known = _is_finite(source[row + i])
            count[start + i] += 1.0 if is_known else 0.0
            mean[start + i] += source[row + i] if is_known else 0.0
    for i in range(rows):
        mean[start + i] /= count[start + i] if count[start + i] > 1.0 else 1.0
    for row in range(first, first + height):
        for i in range(rows):
            deviation = source[row + i] - mean[start + i]
            squares[start + i] += deviation * deviation if _is_finite(source[row + i]) else 0.0


@loop(
    "float64*",
    ("int64", 2),
    ("int64", 2),
    "float64*",
    "float64*",
    "float64*",
    "float64*",
    "float64*",
)
def sum_squares(
    source: Any,
    window: Any,
    size: Any,
    numbers: Any,
    count: Any,
    mean: Any,
    squares: Any,
    totals: Any,
) -> None:
    """Write the sums of squared deviations of the finite values in windows from a number each.

    Takes arrays in Fortran order: the values under windows of this height and width, a number for
    each of the `size` (rows, columns) windows; memory for number, mean and squares of the values in
    each column of a window; and the sums.
    """
    (height, width), (rows, columns) = window, size
    for column in range(columns + width - 1):
        _fold_column(source, height, rows, column * rows, count, mean, squares)
    for start in range(0, columns * rows, rows):
        for i in range(start, start + rows):
            totals[i] = 0.0
        for shift in range(0, width * rows, rows):
            for i in range(start, start + rows):
                number = numbers[i] if _is_finite(numbers[i]) else 0.0
                deviation = mean[shift + i] - number
                total = totals[i] + deviation * deviation * count[shift + i]
                totals[i] = total + squares[shift + i]
        for i in range(start, start + rows):
            totals[i] *= 1.0 if _is_finite(numbers[i]) else 0.0
