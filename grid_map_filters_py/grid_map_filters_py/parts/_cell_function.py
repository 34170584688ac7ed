# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Functions of the values of one cell, applied to all cells of a map.

A function is written once, with operators, `choose` and `clamp`, and computes with numbers as well
as with arrays. If numba is installed, it is compiled to a loop over the cells as soon as a filter
needs it. Without numba, NumPy computes the same bits, piece by piece and several times slower,
because it passes through memory once per operator.
"""

import functools
import inspect
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, SupportsFloat, TypeAlias

import numpy as np
import numpy.typing as npt

from grid_map_core_py.arrays import Layer, elementwise

from .._filter import warn

Value: TypeAlias = Any
"""A number of one cell, or an array with the numbers of all cells."""

_ZERO = np.float32(0)

_compiling = threading.Lock()

_LIKE_NUMPY = {"error_model": "numpy"}
"""Options of numba: division by 0 gives an infinity or NaN."""


def choose(condition: Value, yes: Value, no: Value) -> Value:
    """Return `yes` where the condition holds, else `no`."""
    return np.where(condition, yes, no)


def clamp(value: Value, lowest: np.float32, highest: np.float32) -> Value:
    """Return a value clamped to [lowest, highest]; NaN becomes the lowest."""
    return choose(value > lowest, choose(value < highest, value, highest), lowest)


def is_finite(value: Value) -> Value:
    """Return True where a float is neither NaN nor infinite."""
    return value - value == _ZERO


_helpers: list[Callable[..., Value]] = [clamp, is_finite]
"""Functions that are not registered with numba yet."""


def helper(function: Callable[..., Value]) -> Callable[..., Value]:
    """Allow cell functions to call this function; for use as a decorator."""
    _helpers.append(function)
    return function


@dataclass(frozen=True, eq=False)
class CellFunction:
    """A function of the values of one cell; for use as a decorator, through `cell_function`.

    Attributes:
        function: takes one value per layer, and last a tuple of numbers that are the same for all
            cells. Its constants must be float32 or uint32 like the values: a Python number would
            widen the result.
        takes: type of the values: float32, or uint32 for the bits of colors.
        gives: type of the result, float32 or uint32.
        numbers: length of the tuple of float32 numbers.
    """

    function: Callable[..., Value]
    takes: npt.DTypeLike
    gives: npt.DTypeLike
    numbers: int

    @property
    def layers(self) -> int:
        """Number of layers that the function takes."""
        return len(inspect.signature(self.function).parameters) - 1

    def prepare(self) -> None:
        """Compile the function in advance, which takes up to a second."""
        one_cell = np.zeros(1, self.takes)
        self((one_cell,) * self.layers, (0.0,) * self.numbers)

    def __call__(
        self, layers: Sequence[npt.NDArray[Any]], numbers: Sequence[SupportsFloat] = ()
    ) -> Layer:
        """Return the layer of the function's results.

        Args:
            layers: arrays of one shape in Fortran order, one per argument of the function.
            numbers: last argument of the function.

        Returns:
            float32 whose bits are the results, in the shape of the layers, in Fortran order.
        """
        flat = tuple(layer.ravel("F").view(self.takes) for layer in layers)
        # Numba compiles anew for each combination of read-only and other arrays.
        for values in flat:
            values.flags.writeable = False
        with np.errstate(over="ignore"):
            constants = tuple(np.float32(float(number)) for number in numbers)
        if self._loop is None:
            results = self.plain(flat, constants)
        else:
            results = np.empty(flat[0].size, self.gives)
            self._loop(flat, constants, results)
        return results.view(np.float32).reshape(layers[0].shape, order="F")

    def plain(
        self, layers: Sequence[npt.NDArray[Any]], numbers: tuple[np.float32, ...]
    ) -> npt.NDArray[Any]:
        """Return the results for layers (n,), computed by NumPy."""
        with np.errstate(all="ignore"):
            return elementwise(lambda *cells: self.function(*cells, numbers), self.gives, *layers)

    @functools.cached_property
    def _loop(self) -> Callable[..., None] | None:
        # Since Python 3.12, several threads may come here at once. None may compile before all
        # helpers are registered.
        with _compiling:
            numba = _numba()
            if numba is None:
                return None
            compile_ = numba.njit(**_LIKE_NUMPY)
            function, arguments = compile_(self.function), compile_(_ARGUMENTS[self.layers])

            def loop(layers: Any, numbers: Any, results: Any) -> None:
                for i in range(results.size):
                    results[i] = function(*arguments(layers, i, numbers))

            compiled: Callable[..., None] = compile_(loop)
            return compiled


def cell_function(
    *, takes: npt.DTypeLike, gives: npt.DTypeLike, numbers: int = 0
) -> Callable[[Callable[..., Value]], CellFunction]:
    """Return the decorator that makes a `CellFunction`, with the arguments of that class."""
    return lambda function: CellFunction(function, takes, gives, numbers)


def _numba() -> Any:
    """Return numba with all helpers registered; None if it is missing, broken or turned off."""
    try:
        import numba
        from numba.extending import overload, register_jitable
    except ImportError:
        return None
    # A numba that was built for another NumPy, or lacks a library, raises SystemError,
    # AttributeError, OSError, ...
    except Exception as error:
        warn(f"numba cannot be used, NumPy does its work: {type(error).__name__}: {error}")
        return None
    # With NUMBA_DISABLE_JIT, the loops would run in pure Python.
    if getattr(numba.config, "DISABLE_JIT", False):
        return None
    _compile_choose(overload)
    while _helpers:
        register_jitable(**_LIKE_NUMPY)(_helpers.pop())
    return numba


@functools.cache
def _compile_choose(overload: Callable[..., Any]) -> None:
    """Give `choose` a version for single cells."""
    # Numba compares each signature with that of `choose`, ignoring annotations.
    one_of_both = lambda condition, yes, no: yes if condition else no  # noqa: E731
    overload(choose)(lambda condition, yes, no: one_of_both)  # noqa: ARG005


# Numba compiles no tuple of a variable number of elements.
_ARGUMENTS: dict[int, Callable[..., tuple[Value, ...]]] = {
    1: lambda a, i, numbers: (a[0][i], numbers),
    2: lambda a, i, numbers: (a[0][i], a[1][i], numbers),
    3: lambda a, i, numbers: (a[0][i], a[1][i], a[2][i], numbers),
    5: lambda a, i, numbers: (a[0][i], a[1][i], a[2][i], a[3][i], a[4][i], numbers),
}
"""Functions that return the arguments for cell `i` of layers, by the number of layers."""
