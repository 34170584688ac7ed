# SPDX-License-Identifier: BSD-3-Clause
"""Functions that are applied to each cell of a map.

A function uses only operators and helpers such as `choose` and `clamp`, so that it works for
numbers and for arrays. If numba is installed, the function is compiled on first use. Otherwise,
NumPy evaluates it, which is several times slower. The results are bitwise equal.
"""

import functools
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, SupportsFloat, TypeAlias

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer, elementwise, slices
from grid_map_core_py._loops import Loop

from ._side_by_side import CELLS, side_by_side

Value: TypeAlias = Any
"""The value of one cell, or an array with the values of all cells."""

_ZERO = np.float32(0)


def choose(condition: Value, yes: Value, no: Value) -> Value:
    """Return `yes` where the condition is true, else `no`."""
    return np.where(condition, yes, no)


def _choose_one(condition: Value, yes: Value, no: Value) -> Value:
    return yes if condition else no


def clamp(value: Value, lowest: np.float32, highest: np.float32) -> Value:
    """Clamp a value to [lowest, highest]; NaN becomes `lowest`."""
    return choose(value > lowest, choose(value < highest, value, highest), lowest)


def is_finite(value: Value) -> Value:
    """Return True where a value is neither NaN nor infinite."""
    return value - value == _ZERO


@dataclass(frozen=True, eq=False)
class CellFunction:
    """Function that is applied to each cell, created with the decorator `cell_function`.

    Attributes:
        function: called with one value per layer, followed by a tuple of numbers that are the same
            for all cells. Constants in the function must be float32 or uint32, because a Python
            number would widen the result.
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
        """Number of layers that the function requires."""
        return len(inspect.signature(self.function).parameters) - 1

    def prepare(self) -> None:
        """Compile the function in advance."""
        self._loop.compiled()

    def __call__(
        self, layers: Sequence[npt.NDArray[Any]], numbers: Sequence[SupportsFloat] = ()
    ) -> Layer:
        """Apply the function to all cells and return the results as a layer.

        Args:
            layers: arrays of equal shape in Fortran order, one per argument of the function.
            numbers: numbers that the function receives as its last argument.

        Returns:
            Float32 array in Fortran order, with the shape of the layers. A uint32 result is viewed
            as float32.
        """
        flat = tuple(layer.ravel("F").view(self.takes) for layer in layers)
        with np.errstate(over="ignore"):
            constants = tuple(np.float32(float(number)) for number in numbers)
        compiled = self._loop.compiled()
        for values in flat:
            values.flags.writeable = False  # as in the compiled signature
        # The compiled function does not check the lengths of arrays.
        if len({values.size for values in flat}) > 1:
            compiled = None
        results = np.empty(flat[0].size, self.gives)

        def compute(part: slice) -> None:
            cells, computed = tuple(values[part] for values in flat), results[part]
            if compiled is None:
                computed[...] = self.plain(cells, constants)
            else:
                compiled(cells, constants, computed, computed.size)

        side_by_side(compute, slices(results.size, CELLS))
        return results.view(np.float32).reshape(layers[0].shape, order="F")

    def plain(
        self, layers: Sequence[npt.NDArray[Any]], numbers: tuple[np.float32, ...]
    ) -> npt.NDArray[Any]:
        """Compute the results for flat layers (n,) with NumPy."""
        with np.errstate(all="ignore"):
            return elementwise(lambda *cells: self.function(*cells, numbers), self.gives, *layers)

    @functools.cached_property
    def _loop(self) -> Loop:
        function, arguments = self.function, _ARGUMENTS[self.layers]

        def loop(layers: Any, numbers: Any, results: Any, count: int) -> None:
            for i in range(count):
                results[i] = function(*arguments(layers, i, numbers))

        # The name of the file in numba's cache.
        loop.__qualname__ = f"{function.__module__.rpartition('.')[2]}.{function.__name__}"
        takes, gives = f"const {np.dtype(self.takes)}*", f"{np.dtype(self.gives)}*"
        kinds = (takes, self.layers), ("float32", self.numbers), gives, "int64"
        return Loop(loop, kinds, {choose: _choose_one})


def cell_function(
    *, takes: npt.DTypeLike, gives: npt.DTypeLike, numbers: int = 0
) -> Callable[[Callable[..., Value]], CellFunction]:
    """Return a decorator that creates a `CellFunction`; see there for the arguments."""
    return lambda function: CellFunction(function, takes, gives, numbers)


# Numba cannot compile tuples of variable length.
_ARGUMENTS: dict[int, Callable[..., tuple[Value, ...]]] = {
    1: lambda a, i, numbers: (a[0][i], numbers),
    2: lambda a, i, numbers: (a[0][i], a[1][i], numbers),
    3: lambda a, i, numbers: (a[0][i], a[1][i], a[2][i], numbers),
    5: lambda a, i, numbers: (a[0][i], a[1][i], a[2][i], a[3][i], a[4][i], numbers),
}
"""For each number of layers, a function that returns the arguments for cell `i`."""
