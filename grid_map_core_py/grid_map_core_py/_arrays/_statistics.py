# SPDX-License-Identifier: BSD-3-Clause
"""Statistics of the finite values of an array of any shape and real type.

NaN and infinite values are ignored. Without finite values, `number_of_finites` returns 0, and all
other functions return NaN. Sums are computed in double precision.

Example:
    >>> mean_of_finites(np.array([[1.0, np.nan], [np.inf, 3.0]]))
    2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._checks import as_numbers
from ._pieces import slices

_PIECE = 2**17


def number_of_finites(values: ArrayLike) -> int:
    """Return the number of finite values."""
    return sum(int(np.count_nonzero(np.isfinite(piece))) for piece in _pieces(values))


def sum_of_finites(values: ArrayLike) -> float:
    """Return the sum of the finite values, or NaN if there are none."""
    total = float(sum(map(_sum, _pieces(values))))
    return total if total != 0.0 or number_of_finites(values) else np.nan


def mean_of_finites(values: ArrayLike) -> float:
    """Return the mean of the finite values, or NaN if there are none."""
    number = number_of_finites(values)
    return float(sum(map(_sum, _pieces(values)))) / number if number else np.nan


def min_of_finites(values: ArrayLike) -> float:
    """Return the smallest finite value, or NaN if there are none."""
    return _extreme(np.fmin, values)


def max_of_finites(values: ArrayLike) -> float:
    """Return the largest finite value, or NaN if there are none."""
    return _extreme(np.fmax, values)


def _pieces(values: ArrayLike) -> Iterator[NDArray[Any]]:
    flat = as_numbers(values, "values").ravel("K")
    return (flat[piece] for piece in slices(flat.size, _PIECE))


def _sum(values: NDArray[Any]) -> float:
    if values.dtype == np.float32:
        # Replacing NaN is twice as fast as selecting finite values, but fails with infinities.
        with np.errstate(invalid="ignore"):
            total = float(cv2.patchNaNs(values.copy(), 0.0).sum(dtype=np.float64))
        if np.isfinite(total):
            return total
    return float(values[np.isfinite(values)].sum(dtype=np.float64))


def _extreme(choose: np.ufunc, values: ArrayLike) -> float:
    result = np.nan
    for piece in _pieces(values):
        extreme = choose.reduce(piece)
        if np.isinf(extreme):
            extreme = choose.reduce(piece[np.isfinite(piece)], initial=np.nan)
        result = float(choose(result, extreme))
    return result
