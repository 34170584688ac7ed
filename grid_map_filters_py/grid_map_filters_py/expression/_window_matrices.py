# SPDX-License-Identifier: BSD-3-Clause
"""Evaluates expressions on the windows of many cells with few NumPy calls.

A matrix in an expression consists of one small matrix for each cell. Element (i, j) is an array
with one value per cell, or a number that all cells share.

Elements are computed on demand and freed after use to save memory. Arrays use double precision,
because heights in a window may be large but almost equal. Numbers are rounded to float32.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._functions import FINITE_COUNT, FINITE_SUM
from ._matrices import SCALAR, Fold, Matrices, Shape, Value, apply, common_shape, shape_of

Field = NDArray[np.float64]
Element = float | Field


class WindowMatrix:
    """A small matrix for every cell of the map.

    Args:
        shape: (rows, columns) of the matrix.
        at: function that returns the element at a row and column: a number, or an array with one
            value per cell. The caller may overwrite a writable array. `at` must not refer to the
            matrix, because a reference cycle delays the release of memory.
    """

    def __init__(self, shape: Shape, at: Callable[[int, int], Element]) -> None:
        self.shape = shape
        self.at = at
        self.folds: dict[tuple[int | None, Fold], Value] = {}

    def reduce(self, folds: Sequence[Fold]) -> list[Element]:
        rows, columns = self.shape
        elements = (self.at(row, column) for column in range(columns) for row in range(rows))
        return _accumulate(elements, folds, rows * columns)


class SlidingWindow(WindowMatrix):
    """A window of the given shape that slides over `source`, which becomes read-only."""

    def __init__(self, source: Field, shape: Shape) -> None:
        height, width = (side - part + 1 for side, part in zip(source.shape, shape, strict=True))
        super().__init__(shape, lambda i, j: source[i : i + height, j : j + width])
        self.source = source
        source.flags.writeable = False

    def reduce(self, folds: Sequence[Fold]) -> list[Element]:
        """Fold along one axis and then along the other, which needs only rows + columns steps."""
        return [_fold_box(fold, self.source, self.shape) for fold in folds]


class WeightedWindow(WindowMatrix):
    """Elementwise product of a constant kernel and a sliding window."""

    def __init__(self, kernel: NDArray[np.float32], window: SlidingWindow) -> None:
        super().__init__(window.shape, lambda i, j: float(kernel[i, j]) * window.at(i, j))
        self._kernel = kernel
        self._window = window

    def reduce(self, folds: Sequence[Fold]) -> list[Element]:
        if not set(folds) <= {FINITE_COUNT, FINITE_SUM} or not np.isfinite(self._kernel).all():
            return super().reduce(folds)
        cleaned = SlidingWindow(FINITE_SUM.map(self._window.source), self._window.shape)
        total = np.zeros_like(cleaned.at(0, 0))
        if FINITE_SUM in folds:
            for row, column in np.argwhere(self._kernel):
                total += cleaned.at(row, column) * float(self._kernel[row, column])
        return [total if fold is FINITE_SUM else self._window.reduce([fold])[0] for fold in folds]


class DeviatingWindow(WindowMatrix):
    """Difference between a sliding window and a number per cell."""

    def __init__(self, window: SlidingWindow, number: WindowMatrix) -> None:
        super().__init__(window.shape, lambda i, j: window.at(i, j) - number.at(0, 0))
        self.window = window
        self.number = number


class SquaredDeviations(WindowMatrix):
    """Squared differences between a window and a number per cell, such as the window mean."""

    def __init__(self, deviations: DeviatingWindow) -> None:
        super().__init__(deviations.shape, lambda i, j: np.square(deviations.at(i, j)))
        self._source = deviations.window.source
        self._number = deviations.number.at(0, 0)

    def reduce(self, folds: Sequence[Fold]) -> list[Element]:
        if not set(folds) <= {FINITE_COUNT, FINITE_SUM}:
            return super().reduce(folds)
        total = self._sum()
        results = [
            np.asarray(
                total
                if fold is FINITE_SUM
                else _fold_box(fold, self._source, self.shape) * np.isfinite(self._number)
            )
            for fold in folds
        ]
        too_large = ~np.isfinite(total)
        if too_large.any():
            # Squares beyond the double-precision range are not finite, so the sum omits them. Only
            # these cells are replaced, so that no result depends on the block.
            for result, exact in zip(results, super().reduce(folds), strict=True):
                np.copyto(result, exact, where=too_large)
        return [*results]

    def _sum(self) -> Element:
        """Return the sum of squares without loss of precision by cancellation."""
        height, width = self.shape
        count, mean = (
            np.asarray(_fold_box(fold, self._source, (height, 1)))
            for fold in (FINITE_COUNT, FINITE_SUM)
        )
        mean /= np.maximum(count, 1.0)
        missing = ~np.isfinite(self._source)
        squares = np.zeros_like(mean)
        for row in range(height):
            rows = slice(row, row + len(mean))
            deviation = self._source[rows] - mean
            deviation *= deviation
            np.copyto(deviation, 0.0, where=missing[rows])
            squares += deviation
        finite = np.isfinite(self._number)
        number = np.where(finite, self._number, 0.0)
        cells = mean.shape[1] - width + 1
        total = np.zeros((mean.shape[0], cells), order="F")
        for place in range(width):
            columns = slice(place, place + cells)
            deviation = mean[:, columns] - number
            deviation *= deviation
            deviation *= count[:, columns]
            total += deviation
            total += squares[:, columns]
        return np.asarray(total * finite)


def mean_padded_window(layer: NDArray[Any], cells: NDArray[np.bool_], size: int) -> WindowMatrix:
    """Return the windows of the cells in the mask `cells`, padded with their mean beyond the map.

    The mean ignores non-finite values. Each element is an (N,) array, one value per chosen cell.
    """
    margin, shape = size // 2, (size, size)
    source = np.asfortranarray(np.pad(layer, margin, constant_values=np.nan), np.float64)
    outside = np.pad(np.zeros(layer.shape, np.bool_), margin, constant_values=True).ravel("F")
    # Index in `flat` of the first element of each window, and distance between columns.
    first, step = np.flatnonzero(np.pad(cells, (0, 2 * margin)).ravel("F")), len(source)
    flat = source.ravel("F")
    count, total = (
        np.asarray(_fold_box(fold, source, shape)).T[cells.T] for fold in (FINITE_COUNT, FINITE_SUM)
    )
    mean = np.divide(total, count)

    def at(i: int, j: int) -> Element:
        return np.where(outside[first + (i + j * step)], mean, flat[first + (i + j * step)])

    return WindowMatrix(shape, at)


class WindowMatrices(Matrices):
    """Primitive operations on `WindowMatrix` values, numbers and matrices."""

    def elementwise(self, function: Callable[..., Any], *values: Value) -> Value:
        if not any(isinstance(value, WindowMatrix) for value in values):
            return super().elementwise(function, *values)
        shape = common_shape(values)
        return _shortcut(function, values) or _matrix(
            shape,
            lambda row, column: apply(
                function, [_element(value, row, column) for value in values], np.float64
            ),
        )

    def fold(self, value: Value, axis: int | None, *folds: Fold) -> list[Value]:
        if not isinstance(value, WindowMatrix):
            return super().fold(value, axis, *folds)
        new = [fold for fold in folds if (axis, fold) not in value.folds]
        for fold, result in zip(new, _reduce(value, axis, new), strict=True):
            value.folds[axis, fold] = result
        return [value.folds[axis, fold] for fold in folds]

    def product(self, left: Value, right: Value) -> Value:
        if not isinstance(left, WindowMatrix) and not isinstance(right, WindowMatrix):
            return super().product(left, right)
        (rows, inner), columns = shape_of(left), shape_of(right)[1]

        def at(row: int, column: int) -> Element:
            total: Element = 0.0
            for k in range(inner):
                factors = [_element(left, row, k), _element(right, k, column)]
                total = apply(np.add, [total, apply(np.multiply, factors, np.float64)], np.float64)
            return total

        return _matrix((rows, columns), at)

    def transpose(self, value: Value) -> Value:
        if not isinstance(value, WindowMatrix):
            return super().transpose(value)
        rows, columns = value.shape
        return _matrix((columns, rows), lambda row, column: value.at(column, row))

    def take(self, value: Value, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Value:
        if not isinstance(value, WindowMatrix):
            return super().take(value, rows, columns)
        return _matrix((rows.size, columns.size), lambda i, j: value.at(rows[i], columns[j]))

    def stack(self, blocks: Sequence[Sequence[Value]]) -> Value:
        if not any(isinstance(block, WindowMatrix) for row in blocks for block in row):
            return super().stack(blocks)
        places = [
            [(block, i, j) for block in row for j in range(shape_of(block)[1])]
            for row in blocks
            for i in range(shape_of(row[0])[0])
        ]
        return _matrix((len(places), len(places[0])), lambda i, j: _element(*places[i][j]))


def _shortcut(function: Callable[..., Any], values: Sequence[Value]) -> WindowMatrix | None:
    """Return an elementwise result that has a faster `reduce`, or None."""
    if all(isinstance(value, SlidingWindow | float) for value in values):
        shape = next(value.shape for value in values if isinstance(value, SlidingWindow))
        sources = [
            value.source if isinstance(value, SlidingWindow) else _element(value, 0, 0)
            for value in values
        ]
        return SlidingWindow(apply(function, sources, np.float64), shape)
    if function is np.subtract and len(values) == 2:
        window, number = values
        if isinstance(window, SlidingWindow) and isinstance(number, WindowMatrix):
            return DeviatingWindow(window, number) if number.shape == SCALAR else None
    if function is np.square and isinstance(values[0], DeviatingWindow):
        return SquaredDeviations(values[0])
    kinds = {type(value) for value in values if shape_of(value) != SCALAR}
    if function is np.multiply and kinds == {SlidingWindow, np.ndarray}:
        (kernel,) = (value for value in values if isinstance(value, np.ndarray))
        (window,) = (value for value in values if isinstance(value, SlidingWindow))
        return WeightedWindow(kernel, window)
    return None


def _accumulate(elements: Iterable[Element], folds: Sequence[Fold], count: int) -> list[Element]:
    """Fold at most `count` elements, computing each element once."""
    totals: list[Any] = []
    counter = np.min_scalar_type(count)
    for element in elements:
        mapped = [fold.map(element) for fold in folds]
        if not totals:
            totals = [
                # Count truth values in the smallest sufficient integer type.
                np.array(values, counter if np.asarray(values).dtype == np.bool_ else np.float64)
                if np.ndim(values)
                else float(values)
                for values in mapped
            ]
            continue
        for place, (fold, values) in enumerate(zip(folds, mapped, strict=True)):
            out = totals[place] if isinstance(totals[place], np.ndarray) else None
            totals[place] = fold.combine(totals[place], values, out=out)
    return [_as_element(total) for total in totals]


def _reduce(value: WindowMatrix, axis: int | None, folds: Sequence[Fold]) -> list[Value]:
    if axis is None:
        return [_field(total) for total in value.reduce(folds)]
    rows, columns = value.shape
    if axis == 0:
        lines = [[(i, j) for i in range(rows)] for j in range(columns)]
    else:
        lines = [[(i, j) for j in range(columns)] for i in range(rows)]
    totals = [_accumulate((value.at(*place) for place in line), folds, len(line)) for line in lines]
    for element in chain.from_iterable(totals):
        _protect(element)
    shape = (1, columns) if axis == 0 else (rows, 1)

    def line(elements: Sequence[Element]) -> Value:
        return _matrix(shape, lambda row, column: elements[row + column])

    return [line(elements) for elements in zip(*totals, strict=True)]


def _fold_box(fold: Fold, source: Field, shape: Shape) -> Element:
    values = fold.map(source)
    if values.dtype == np.bool_:
        values = values.astype(np.min_scalar_type(shape[0] * shape[1]))
    for axis, length in enumerate(shape):
        size = values.shape[axis] - length + 1
        parts = [slice(shift, shift + size) for shift in range(length)]
        lines = [values[part] if axis == 0 else values[:, part] for part in parts]
        values = lines[0] if length == 1 else fold.combine(lines[0], lines[1])
        for line in lines[2:]:
            fold.combine(values, line, out=values)
    return _as_element(values)


def _as_element(total: Any) -> Element:
    if np.ndim(total) == 0:
        return float(total)
    return np.asarray(total, np.float64)


def _matrix(shape: Shape, at: Callable[[int, int], Element]) -> Value:
    """Return a matrix whose elements are computed on demand, or immediately if it is 1 x 1."""
    return _field(at(0, 0)) if shape == SCALAR else WindowMatrix(shape, at)


def _field(element: Element) -> WindowMatrix:
    _protect(element)
    return WindowMatrix(SCALAR, lambda _row, _column: element)


def _protect(element: Element) -> None:
    if isinstance(element, np.ndarray):
        element.flags.writeable = False


def _element(value: Value, row: int, column: int) -> Element:
    """Return an element; a 1 x 1 value has the same element everywhere."""
    if isinstance(value, float):
        return float(np.float32(value))
    if value.shape == SCALAR:
        row = column = 0
    return value.at(row, column) if isinstance(value, WindowMatrix) else float(value[row, column])
