# SPDX-License-Identifier: BSD-3-Clause
"""Evaluates expressions on matrices (float32 arrays) and numbers (Python floats).

Layers are read-only views. Writable arrays are temporary results that may be overwritten.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ._nodes import Fault

Shape = tuple[int, int]
Value: TypeAlias = Any
"""A number, a 2-D float32 matrix, or one matrix for every cell (see `WindowMatrix`)."""

SCALAR: Shape = (1, 1)


@dataclass(frozen=True, eq=False)
class Fold:
    """Reduction that applies `map` to every element and combines the results in any order.

    The optional `whole` reduces an array faster, but may return NaN if no element is finite.
    """

    map: Callable[[Any], Any]
    combine: np.ufunc
    whole: Callable[[NDArray[Any]], float] | None = None


def known(value: Value, *, argument: int | None = None) -> Value:
    """Return `value`; raise a Fault if it is a `WindowMatrix`, whose value depends on the cell."""
    if not isinstance(value, float | np.ndarray):
        raise Fault("this must not depend on the data of the window", argument=argument)
    return value


def shape_of(value: Value) -> Shape:
    return SCALAR if isinstance(value, float) else (value.shape[0], value.shape[1])


def common_shape(values: Iterable[Value]) -> Shape:
    larger = list(dict.fromkeys(shape for shape in map(shape_of, values) if shape != SCALAR))
    if len(larger) > 1:
        raise Fault(f"the shapes {' and '.join(map(describe, larger))} do not match")
    return larger[0] if larger else SCALAR


def describe(shape: Shape) -> str:
    return f"{shape[0]} x {shape[1]}"


class Matrices:
    """Primitive operations of the expression language, applied to numbers and matrices.

    Args:
        spare: float32 array to overwrite with the first result of its shape, or None.
    """

    def __init__(self, spare: NDArray[np.float32] | None = None) -> None:
        self._spare = spare

    def elementwise(self, function: Callable[..., Any], *values: Value) -> Value:
        """Apply `function` elementwise to values of equal shape; 1 x 1 values are repeated."""
        shape, spare = common_shape(values), self._spare
        if spare is None or spare.shape != shape:
            return apply(function, values, np.float32)
        result = apply(function, values, np.float32, spare)
        self._spare = None if result is spare else spare
        return result

    def fold(self, value: Value, axis: int | None, *folds: Fold) -> list[Value]:
        """Reduce all elements (axis None), each column (0) or each row (1), in double precision."""
        return [_reduce(as_matrix(value), axis, fold) for fold in folds]

    def product(self, left: Value, right: Value) -> Value:
        """Return the matrix product of values with compatible shapes."""
        # The product of the transposes gives the result in Fortran order.
        return (as_matrix(right).T @ as_matrix(left).T).T

    def transpose(self, value: Value) -> Value:
        """Return the transpose of a value."""
        return value if isinstance(value, float) else value.T

    def take(self, value: Value, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Value:
        """Select existing rows and columns; a single cell becomes a number."""
        return simplified(as_matrix(value)[_as_slice(rows)][:, _as_slice(columns)])

    def stack(self, blocks: Sequence[Sequence[Value]]) -> Value:
        """Combine rows of blocks with compatible shapes into a matrix."""
        rows = [np.concatenate([as_matrix(block) for block in row], axis=1) for row in blocks]
        return simplified(np.asfortranarray(np.concatenate(rows, axis=0)))


class Partial(Matrices):
    """Primitive operations on one tile that also append the result of each fold to `parts`."""

    def __init__(self) -> None:
        super().__init__()
        self.parts: list[float] = []

    def fold(self, value: Value, axis: int | None, *folds: Fold) -> list[Value]:
        # `whole` is not used, because it may return NaN for a tile without finite elements.
        parts = super().fold(value, axis, *(replace(fold, whole=None) for fold in folds))
        self.parts += parts
        return parts


class Combined(Matrices):
    """Primitive operations on a tiled map, given the partial results of all tiles.

    Args:
        parts: for each fold in order of evaluation, the results of all tiles; see `Partial`.
    """

    def __init__(self, parts: Iterable[Sequence[float]]) -> None:
        super().__init__()
        self._parts = iter(parts)

    def fold(self, _value: Value, _axis: int | None, *folds: Fold) -> list[Value]:
        return [float(reduce(fold.combine, next(self._parts))) for fold in folds]


def simplified(matrix: NDArray[np.float32]) -> Value:
    """Convert a 1 x 1 matrix to a number; leave other matrices unchanged."""
    return float(matrix.item()) if matrix.size == 1 else matrix


def as_matrix(value: Value) -> NDArray[np.float32]:
    """Convert a number to a 1 x 1 matrix; leave matrices unchanged."""
    return np.full(SCALAR, value, np.float32) if isinstance(value, float) else value


def apply(
    function: Callable[..., Any],
    values: Sequence[Any],
    dtype: type[np.floating[Any]],
    spare: NDArray[Any] | None = None,
) -> Any:
    """Apply an elementwise function to floats and arrays; truth values become 1 and 0.

    The result may overwrite `spare` or a writable array in `values`.
    """
    if isinstance(function, np.ufunc):
        # Temporary arrays may be overwritten, except 1 x 1 arrays, which may be too small.
        for value in values:
            if isinstance(value, np.ndarray) and value.flags.writeable and value.size > 1:
                spare = value if value.dtype == dtype else spare
                break
        result = function(*values, out=spare)
    else:
        result = function(*values)
    return float(result) if np.ndim(result) == 0 else result.astype(dtype, copy=False)


def _reduce(matrix: NDArray[np.float32], axis: int | None, fold: Fold) -> Value:
    if axis is None and fold.whole is not None:
        return float(fold.whole(matrix))
    values = fold.map(matrix)
    wide = np.float64 if fold.combine in (np.add, np.multiply) else None
    result = fold.combine.reduce(values, axis=axis, dtype=wide, keepdims=axis is not None)
    return float(result) if axis is None else result.astype(np.float32)


def _as_slice(places: NDArray[np.intp]) -> slice | NDArray[np.intp]:
    """Convert consecutive indices to a slice, to avoid a copy."""
    consecutive = places.size > 0 and bool(np.all(np.diff(places) == 1))
    return slice(int(places[0]), int(places[-1]) + 1) if consecutive else places
