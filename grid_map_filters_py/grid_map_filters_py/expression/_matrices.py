# SPDX-License-Identifier: BSD-3-Clause
"""Evaluation on whole matrices: numbers are Python floats, matrices are float32 arrays.

A Python float takes the type of the array it is combined with, in NumPy 1 and 2: float32 stays
float32. Arrays of the user are read-only. A writeable array is therefore a temporary of the
evaluation; the next operation may write its result into it.
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
"""A number, a 2-D float32 matrix, or a matrix that depends on a window (see `WindowMatrix`)."""

SCALAR: Shape = (1, 1)


@dataclass(frozen=True, eq=False)
class Fold:
    """A reduction: `map` every element, then `combine` them in any order.

    `whole`, if given, reduces a whole array faster, and returns NaN if there is nothing to reduce.
    """

    map: Callable[[Any], Any]
    combine: np.ufunc
    whole: Callable[[NDArray[Any]], float] | None = None


def known(value: Value, *, argument: int | None = None) -> Value:
    """Return a number or matrix; raise a Fault, about an `argument`, if it depends on a window."""
    if not isinstance(value, float | np.ndarray):
        raise Fault("this must not depend on the data of the window", argument=argument)
    return value


def shape_of(value: Value) -> Shape:
    """Return (rows, columns); a number is 1 x 1."""
    return SCALAR if isinstance(value, float) else (value.shape[0], value.shape[1])


def common_shape(values: Iterable[Value]) -> Shape:
    """Return the shape of an elementwise result; 1 x 1 fits every shape."""
    larger = list(dict.fromkeys(shape for shape in map(shape_of, values) if shape != SCALAR))
    if len(larger) > 1:
        raise Fault(f"the shapes {' and '.join(map(describe, larger))} do not match")
    return larger[0] if larger else SCALAR


def describe(shape: Shape) -> str:
    return f"{shape[0]} x {shape[1]}"


class Matrices:
    """The primitive operations of the language, on numbers and matrices.

    Args:
        spare: float32 memory for the first temporary of its shape; None if there is none.
    """

    def __init__(self, spare: NDArray[np.float32] | None = None) -> None:
        self._spare = spare

    def elementwise(self, function: Callable[..., Any], *values: Value) -> Value:
        """Apply `function` to equal shapes; 1 x 1 matrices are repeated.

        Matrices are computed in float32, numbers in double precision.
        """
        shape, spare = common_shape(values), self._spare
        if spare is None or spare.shape != shape:
            return apply(function, values, np.float32)
        result = apply(function, values, np.float32, spare)
        self._spare = None if result is spare else spare
        return result

    def fold(self, value: Value, axis: int | None, *folds: Fold) -> list[Value]:
        """Reduce everything to 1 x 1, or per column (axis 0) or row (1), in double precision."""
        return [_reduce(as_matrix(value), axis, fold) for fold in folds]

    def product(self, left: Value, right: Value) -> Value:
        """Multiply matrices of fitting shapes."""
        # Transposed, so that the result is in Fortran order.
        return (as_matrix(right).T @ as_matrix(left).T).T

    def transpose(self, value: Value) -> Value:
        """Swap rows and columns."""
        return value if isinstance(value, float) else value.T

    def take(self, value: Value, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Value:
        """Pick rows and columns that exist; a single cell is a number."""
        return simplified(as_matrix(value)[_as_slice(rows)][:, _as_slice(columns)])

    def stack(self, blocks: Sequence[Sequence[Value]]) -> Value:
        """Put blocks of fitting shapes together."""
        rows = [np.concatenate([as_matrix(block) for block in row], axis=1) for row in blocks]
        return simplified(np.asfortranarray(np.concatenate(rows, axis=0)))


class Partial(Matrices):
    """The primitives on a tile; `parts` has the results of all folds.

    To reduce tile by tile, a function runs with `Partial` on each tile, then once with `Combined`.
    """

    def __init__(self) -> None:
        super().__init__()
        self.parts: list[float] = []

    def fold(self, value: Value, axis: int | None, *folds: Fold) -> list[Value]:
        # Without `whole`, which returns NaN for tiles with nothing to reduce.
        parts = super().fold(value, axis, *(replace(fold, whole=None) for fold in folds))
        self.parts += parts
        return parts


class Combined(Matrices):
    """The primitives for values whose folds are known.

    Args:
        parts: results of each fold in each tile, in the order of the folds.
    """

    def __init__(self, parts: Iterable[Sequence[float]]) -> None:
        super().__init__()
        self._parts = iter(parts)

    def fold(self, _value: Value, _axis: int | None, *folds: Fold) -> list[Value]:
        return [float(reduce(fold.combine, next(self._parts))) for fold in folds]


def simplified(matrix: NDArray[np.float32]) -> Value:
    """Return a 1 x 1 matrix as a number, and any other unchanged."""
    return float(matrix.item()) if matrix.size == 1 else matrix


def as_matrix(value: Value) -> NDArray[np.float32]:
    """Return a number as a 1 x 1 matrix, and a matrix unchanged."""
    return np.full(SCALAR, value, np.float32) if isinstance(value, float) else value


def apply(
    function: Callable[..., Any],
    values: Sequence[Any],
    dtype: type[np.floating[Any]],
    spare: NDArray[Any] | None = None,
) -> Any:
    """Apply an elementwise function; truth values become 1 and 0.

    Args:
        function: a ufunc, or a function of arrays.
        values: floats and arrays of equal shapes (or 1 x 1).
        dtype: dtype of the resulting array.
        spare: memory for the result that may be used in place of new memory.

    Returns:
        A new array or a used-up temporary, or a float if all values are numbers.
    """
    if isinstance(function, np.ufunc):
        # A temporary of the evaluation may be overwritten; a 1 x 1 one may be smaller than the
        # result.
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
    """Return consecutive places as a slice, which copies nothing and keeps the memory order."""
    consecutive = places.size > 0 and bool(np.all(np.diff(places) == 1))
    return slice(int(places[0]), int(places[-1]) + 1) if consecutive else places
