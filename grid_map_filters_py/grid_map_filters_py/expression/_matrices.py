# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Evaluation on whole matrices: numbers are Python floats, matrices are float32 arrays.

A Python float takes the type of the array it is combined with, in NumPy 1 and 2: float32 stays
float32. Arrays of the user and cached values are read-only. A writeable array is therefore a
temporary of the evaluation; the next operation may write its result into it.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._functions import SCALAR, Fold, Plain, Shape, common_shape


def apply(
    function: Callable[..., Any], values: Sequence[Any], dtype: type[np.floating[Any]]
) -> Any:
    """Apply an elementwise function; truth values become 1 and 0.

    Args:
        function: a ufunc, or a function of arrays.
        values: floats and arrays of equal shapes (or 1 x 1).
        dtype: dtype of the resulting array.

    Returns:
        A new array or a used-up temporary, or a float if all values are numbers.
    """
    if isinstance(function, np.ufunc):
        result = function(*values, out=_temporary(values, dtype))
    else:
        result = function(*values)
    return float(result) if np.ndim(result) == 0 else result.astype(dtype, copy=False)


def _temporary(values: Sequence[Any], dtype: type[np.floating[Any]]) -> NDArray[Any] | None:
    """Return a temporary of the evaluation to write into; 1 x 1 may be smaller than the result."""
    for value in values:
        if isinstance(value, np.ndarray) and value.flags.writeable and value.size > 1:
            return value if value.dtype == dtype else None
    return None


class Matrices:
    """The algebra of numbers and matrices; a matrix of one cell that is picked is a number."""

    def constant(self, value: Plain) -> Plain:
        return value

    def known(self, value: Plain) -> Plain:
        return value

    def shape(self, value: Plain) -> Shape:
        return SCALAR if isinstance(value, float) else (value.shape[0], value.shape[1])

    def elementwise(self, function: Callable[..., Any], *values: Plain) -> Plain:
        # In float32, but in double precision between numbers.
        common_shape(map(self.shape, values))
        result: Plain = apply(function, values, np.float32)
        return result

    def fold(self, value: Plain, axis: int | None, *folds: Fold) -> list[Plain]:
        return [_reduce(as_matrix(value), axis, fold) for fold in folds]

    def product(self, left: Plain, right: Plain) -> Plain:
        # Transposed, so that the result is in Fortran order.
        result: NDArray[np.float32] = (as_matrix(right).T @ as_matrix(left).T).T
        return result

    def transpose(self, value: Plain) -> Plain:
        return value if isinstance(value, float) else value.T

    def take(self, value: Plain, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Plain:
        picked = as_matrix(value)[_as_slice(rows)][:, _as_slice(columns)]
        return float(picked.item()) if picked.size == 1 else picked

    def stack(self, blocks: Sequence[Sequence[Plain]]) -> Plain:
        rows = [np.concatenate([as_matrix(block) for block in row], axis=1) for row in blocks]
        stacked = np.asfortranarray(np.concatenate(rows, axis=0))
        return float(stacked.item()) if stacked.size == 1 else stacked


def as_matrix(value: Plain) -> NDArray[np.float32]:
    """Return a number as a 1 x 1 matrix, and a matrix unchanged."""
    return np.full(SCALAR, value, np.float32) if isinstance(value, float) else value


def _reduce(matrix: NDArray[np.float32], axis: int | None, fold: Fold) -> Plain:
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
