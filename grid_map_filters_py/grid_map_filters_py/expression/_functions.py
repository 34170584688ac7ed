# SPDX-License-Identifier: BSD-3-Clause
"""Operators and functions of the expression language, built on the operations of `Matrices`."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grid_map_core_py._arrays import (
    max_of_finites,
    min_of_finites,
    number_of_finites,
    sum_of_finites,
)

from ._matrices import SCALAR, Fold, Matrices, Value, describe, known, shape_of, simplified
from ._nodes import Fault

LARGEST = 10**8
"""Maximum number of elements of a matrix created by an expression."""
CONSTANTS = {"pi": np.pi, "nan": np.nan, "inf": np.inf}


def round_half_away(values: Any) -> Any:
    """Round to the nearest integer; halves are rounded away from zero, as in std::round."""
    whole = np.trunc(values)
    return whole + np.copysign(np.abs(values - whole) >= 0.5, values)


def where(condition: Any, then: Any, otherwise: Any) -> Any:
    """Return `then` where the condition is nonzero or NaN, and `otherwise` where it is zero."""
    return np.where(np.not_equal(condition, 0.0), then, otherwise)


def _finite_or(substitute: float) -> Callable[[Any], Any]:
    def clean(values: Any) -> Any:
        cleaned = np.array(values, order="K")
        np.copyto(cleaned, substitute, where=~np.isfinite(values))  # much faster than np.where
        return cleaned

    return clean


ARITHMETIC = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "^": np.power}
"""Arithmetic operators; a leading dot, as in `.*`, makes an operator elementwise."""

COMPARISONS = {
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
    "==": np.equal,
    "!=": np.not_equal,
}
POWERS = ("^", ".^")


def operate(algebra: Matrices, operator: str, left: Value, right: Value) -> Value:
    """Apply a binary operator."""
    first, second = shape_of(left), shape_of(right)
    if operator in ("*", "/") and SCALAR not in (first, second):
        if operator == "/":
            raise Fault("a matrix cannot be divided by a matrix; use './' for element by element")
        if first[1] != second[0]:
            raise Fault(
                f"no matrix product of {describe(first)} and {describe(second)}; "
                "use '.*' to multiply element by element"
            )
        return algebra.product(left, right)
    if operator in POWERS and isinstance(right, float) and right == 2.0:
        return algebra.elementwise(np.square, left)  # bitwise equal, many times faster
    return algebra.elementwise((ARITHMETIC | COMPARISONS)[operator.lstrip(".")], left, right)


_WRONG_AXIS = "the axis must be 0 (per column) or 1 (per row)"

SUM = Fold(np.asarray, np.add)
SQUARES = Fold(np.square, np.add)
PRODUCT = Fold(np.asarray, np.multiply)
MINIMUM = Fold(np.asarray, np.minimum)
MAXIMUM = Fold(np.asarray, np.maximum)
FINITE_COUNT = Fold(np.isfinite, np.add, number_of_finites)
FINITE_SUM = Fold(_finite_or(0.0), np.add, sum_of_finites)
FINITE_MINIMUM = Fold(_finite_or(np.inf), np.minimum, min_of_finites)
FINITE_MAXIMUM = Fold(_finite_or(-np.inf), np.maximum, max_of_finites)


def _folding(fold: Fold) -> Callable[..., Any]:
    def reduce(algebra: Matrices, value: Value, axis: Value | None = None) -> Value:
        return algebra.fold(value, _axis(axis), fold)[0]

    return reduce


def _extreme(fold: Fold, pairwise: np.ufunc, cwise: str) -> Callable[..., Any]:
    """Create `max` or `min`: a reduction of one matrix, or an elementwise comparison of two."""

    def reduce(algebra: Matrices, value: Value, second: Value | None = None) -> Value:
        if isinstance(second, float) and second not in (0.0, 1.0):
            raise Fault(f"{_WRONG_AXIS}; to compare with a number use {cwise}(m, s)", argument=1)
        if second is None or isinstance(second, float):  # a 1 x 1 layer is a matrix
            return algebra.fold(value, _axis(second), fold)[0]
        return algebra.elementwise(pairwise, value, second)

    return reduce


def _mean(algebra: Matrices, value: Value, axis: Value | None = None) -> Value:
    shape, along = shape_of(value), _axis(axis)
    total = algebra.fold(value, along, SUM)[0]
    count = math.prod(shape) if along is None else shape[along]
    return algebra.elementwise(np.divide, total, float(count))


def _trace(algebra: Matrices, value: Value) -> Value:
    diagonal = [
        algebra.take(value, np.array([place]), np.array([place]))
        for place in range(min(shape_of(value)))
    ]
    return algebra.fold(algebra.stack([diagonal]), None, SUM)[0]


def _axis(axis: Value | None) -> int | None:
    if axis is None:
        return None
    value = known(axis, argument=1)
    if np.size(value) != 1 or float(np.max(value)) not in (0.0, 1.0):
        raise Fault(_WRONG_AXIS, argument=1)
    return int(np.max(value))


def _size(_: Matrices, value: Value, axis: Value | None = None) -> Value:
    shape, along = shape_of(value), _axis(axis)
    return np.array([shape], np.float32) if along is None else float(shape[along])


def _maker(make: Callable[[int, int], NDArray[np.float32]]) -> Callable[..., Any]:
    def made(_: Matrices, rows: Value, columns: Value | None = None) -> Value:
        height = _length(rows, 0)
        width = height if columns is None else _length(columns, 1)
        if height * width > LARGEST:
            raise Fault(f"a matrix of {describe((height, width))} is too large")
        return simplified(make(height, width))

    return made


def _length(value: Value, argument: int) -> int:
    matrix = known(value, argument=argument)
    number = float(np.max(matrix)) if np.size(matrix) == 1 else np.nan
    if not (number >= 1.0 and number.is_integer()):
        raise Fault("the number of rows and columns must be whole and positive", argument=argument)
    return int(number)


@dataclass(frozen=True)
class Function:
    """A function of the expression language.

    Attributes:
        apply: implementation; its first argument is a `Matrices` object.
        least, most: number of further arguments.
        axis: True if the optional second argument may be an axis, 0 or 1.
        elementwise: True if each element of the result depends only on the same element of each
            argument.
        keeps_nan: True if the function is elementwise, and NaN in any argument gives NaN.
        skips_nan: True if the function has one argument and ignores its NaN elements.
        reduces: number of arguments of calls that reduce a matrix, such as 1 for `sum(m)`; 0 if
            none.
    """

    apply: Callable[..., Any]
    least: int = 1
    most: int = 1
    axis: bool = False
    elementwise: bool = False
    keeps_nan: bool = False
    skips_nan: bool = False
    reduces: int = 0


def elementwise(function: Callable[..., Any], arity: int = 1, *, keeps_nan: bool) -> Function:
    """Create a `Function` that applies `function` to each element."""

    def apply(algebra: Matrices, *values: Value) -> Value:
        return algebra.elementwise(function, *values)

    return Function(apply, arity, arity, elementwise=True, keeps_nan=keeps_nan)


def _cwise(function: np.ufunc) -> Function:
    def apply(algebra: Matrices, matrix: Value, other: Value) -> Value:
        if shape_of(matrix) == SCALAR != shape_of(other):
            raise Fault("the matrix comes first and the number second", argument=0)
        return algebra.elementwise(function, matrix, other)

    return Function(apply, 2, 2, elementwise=True, keeps_nan=True)


def of_finites(fold: Fold) -> Function:
    """Create a `Function` that reduces the finite elements, and returns NaN if there are none."""

    def reduce(algebra: Matrices, value: Value) -> Value:
        count, result = algebra.fold(value, None, FINITE_COUNT, fold)
        return algebra.elementwise(
            lambda n, r: np.where(np.equal(n, 0.0), np.nan, r), count, result
        )

    return Function(reduce, skips_nan=True, reduces=1)


FUNCTIONS = {
    "abs": elementwise(np.abs, keeps_nan=True),
    "sqrt": elementwise(np.sqrt, keeps_nan=True),
    "square": elementwise(np.square, keeps_nan=True),
    "exp": elementwise(np.exp, keeps_nan=True),
    "log": elementwise(np.log, keeps_nan=True),
    "log10": elementwise(np.log10, keeps_nan=True),
    "sin": elementwise(np.sin, keeps_nan=True),
    "cos": elementwise(np.cos, keeps_nan=True),
    "tan": elementwise(np.tan, keeps_nan=True),
    "asin": elementwise(np.arcsin, keeps_nan=True),
    "acos": elementwise(np.arccos, keeps_nan=True),
    "atan": elementwise(np.arctan, keeps_nan=True),
    "atan2": elementwise(np.arctan2, 2, keeps_nan=True),
    "sinh": elementwise(np.sinh, keeps_nan=True),
    "cosh": elementwise(np.cosh, keeps_nan=True),
    "tanh": elementwise(np.tanh, keeps_nan=True),
    "floor": elementwise(np.floor, keeps_nan=True),
    "ceil": elementwise(np.ceil, keeps_nan=True),
    "round": elementwise(round_half_away, keeps_nan=True),
    "isfinite": elementwise(np.isfinite, keeps_nan=False),
    "where": elementwise(where, 3, keeps_nan=False),
    "cwiseMin": _cwise(np.minimum),
    "cwiseMax": _cwise(np.maximum),
    "minOfFinites": of_finites(FINITE_MINIMUM),
    "maxOfFinites": of_finites(FINITE_MAXIMUM),
    "meanOfFinites": Function(
        lambda algebra, value: algebra.elementwise(
            np.divide, *algebra.fold(value, None, FINITE_SUM, FINITE_COUNT)
        ),
        skips_nan=True,
        reduces=1,
    ),
    "sumOfFinites": of_finites(FINITE_SUM),
    "numberOfFinites": Function(_folding(FINITE_COUNT), skips_nan=True, reduces=1),
    "min": Function(_extreme(MINIMUM, np.minimum, "cwiseMin"), most=2, axis=True, reduces=1),
    "max": Function(_extreme(MAXIMUM, np.maximum, "cwiseMax"), most=2, axis=True, reduces=1),
    # As in EigenLab, this is the signed value with the largest magnitude.
    "absmax": Function(
        lambda algebra, value, axis=None: algebra.elementwise(
            lambda high, low: np.where(np.abs(high) >= np.abs(low), high, low),
            *algebra.fold(value, _axis(axis), MAXIMUM, MINIMUM),
        ),
        most=2,
        axis=True,
        reduces=1,
    ),
    "mean": Function(_mean, most=2, axis=True, reduces=1),
    "sum": Function(_folding(SUM), most=2, axis=True, reduces=1),
    "prod": Function(_folding(PRODUCT), most=2, axis=True, reduces=1),
    "size": Function(_size, most=2, axis=True, reduces=2),
    "norm": Function(
        lambda algebra, value: algebra.elementwise(np.sqrt, algebra.fold(value, None, SQUARES)[0]),
        reduces=1,
    ),
    "trace": Function(_trace),
    "transpose": Function(lambda algebra, value: algebra.transpose(value)),
    "adjoint": Function(lambda algebra, value: algebra.transpose(value)),
    "conjugate": Function(lambda _, value: value),
    "zeros": Function(_maker(lambda rows, columns: np.zeros((rows, columns), np.float32)), most=2),
    "ones": Function(_maker(lambda rows, columns: np.ones((rows, columns), np.float32)), most=2),
    "eye": Function(_maker(lambda rows, columns: np.eye(rows, columns, dtype=np.float32)), most=2),
}
"""All functions of the language, for layers and for windows."""
