# SPDX-License-Identifier: BSD-3-Clause
"""Loops over cells or points, compiled where numba is installed.

Numba is imported when the first loop is compiled or loaded. It keeps machine code in its own cache.
"""

import importlib
import inspect
import types
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

__all__ = ["Compiled", "Loop", "loop"]

Compiled: TypeAlias = Callable[..., None]
Type: TypeAlias = str | tuple[str, int] | tuple[str, ...]

_callable: set[Callable[..., Any]] = set()
"""Functions that numba can call from compiled code."""


@dataclass(eq=False)
class Loop:
    """A function of flat arrays and numbers that numba compiles; made by the decorator `loop`.

    Attributes:
        function: indexes its arrays with integers from 0, writes its results into arrays and
            returns nothing. It may call `math`, NumPy and functions like itself.
        takes: types of the arguments: "float32*" for an array, "const float32*" for a read-only
            one, "int64" for a number, and ("float32*", 3) or ("int64", "float32*") for a tuple.
            Other types are compiled when they first occur.
        instead: functions that are compiled in place of others that the function calls.

    Example:
        >>> import numpy as np
        >>> @loop("float64*", "int64", "float64*")
        ... def running_sums(values, count, sums):
        ...     total = 0.0
        ...     for i in range(count):
        ...         total += values[i]
        ...         sums[i] = total
        >>> run = running_sums.compiled() or running_sums.function
        >>> sums = np.empty(3)
        >>> run(np.array([1.0, 2.0, 4.0]), 3, sums)
        >>> sums.tolist()
        [1.0, 3.0, 7.0]
    """

    function: Callable[..., None]
    takes: tuple[Type, ...]
    instead: Mapping[Callable[..., Any], Callable[..., Any]] = field(default_factory=dict)

    def compiled(self) -> Compiled | None:
        """Return the compiled function, loaded from numba's cache or compiled in some seconds.

        Its arrays may have any shape and must be contiguous. Other threads run while it runs.

        Returns:
            None if numba is not installed or is turned off by NUMBA_DISABLE_JIT, and with a
            `RuntimeWarning` if it fails.
        """
        return self._compiled

    def must_compile(self) -> bool:
        """Return whether `compiled` would compile now, because numba has cached nothing."""
        if "_compiled" in self.__dict__ or _numba() is None:
            return False
        try:
            folder = self._dispatcher(cache=True).stats.cache_path
        except RuntimeError:  # no folder is writable
            return True
        return not any(Path(folder).glob(f"*.{self.function.__name__}-*.nbi"))

    @cached_property
    def _compiled(self) -> Compiled | None:
        numba = _numba()
        if numba is None:
            return None
        signature = numba.void(*(_numba_type(numba.types, part) for part in self.takes))
        failure = None
        for cache in (True, False):  # numba refuses to cache where it finds no writable folder
            try:
                dispatcher = self._dispatcher(cache=cache)
                dispatcher.compile(signature)
            except Exception as error:
                failure = error
            else:
                return lambda *arguments: dispatcher(*map(_flat, arguments))
        _warn(f"it cannot compile {self.function.__qualname__}", failure)
        return None

    def _dispatcher(self, *, cache: bool) -> Any:
        import numba

        _make_callable(self.function, self.instead)
        make: Any = numba.njit
        return make(nogil=True, error_model="numpy", cache=cache)(self.function)


def loop(*takes: Type) -> Callable[[Callable[..., None]], Loop]:
    """Return the decorator that makes a `Loop` with these types."""
    return lambda function: Loop(function, takes)


def _numba() -> Any:
    """Return the module, or None if it is not installed, is turned off or does not work."""
    try:
        numba: Any = importlib.import_module("numba")
    except ModuleNotFoundError:
        return None
    except Exception as error:
        _warn("it cannot be imported", error)
        return None
    return None if numba.config.DISABLE_JIT else numba


def _warn(text: str, error: Exception | None) -> None:
    said = f"numba: {text}, NumPy does its work: {type(error).__name__}: {error}"
    warnings.warn(said, RuntimeWarning, stacklevel=2)


def _make_callable(
    function: Callable[..., Any], instead: Mapping[Callable[..., Any], Callable[..., Any]]
) -> None:
    """Let compiled code call the Python functions that a function calls."""
    from numba.extending import overload

    names = inspect.getclosurevars(function)
    for called in (*names.globals.values(), *names.nonlocals.values()):
        if isinstance(called, types.FunctionType) and called not in _callable:
            _callable.add(called)
            replacement = instead.get(called, called)
            overload(called, jit_options={"error_model": "numpy"}, strict=False)(
                lambda *_, made=replacement: made
            )
            _make_callable(replacement, instead)


def _numba_type(known: Any, part: Any) -> Any:
    if isinstance(part, str):
        number = getattr(known, part.removeprefix("const ").removesuffix("*"))
        is_read_only = part.startswith("const")
        return known.Array(number, 1, "C", readonly=is_read_only) if "*" in part else number
    if isinstance(part[1], int):
        return known.UniTuple(_numba_type(known, part[0]), part[1])
    return known.Tuple([_numba_type(known, each) for each in part])


def _flat(argument: Any) -> Any:
    if isinstance(argument, tuple):
        return tuple(map(_flat, argument))
    if isinstance(argument, np.ndarray) and argument.ndim != 1:
        if not argument.flags.forc:
            raise TypeError(f"expected a contiguous array, got strides {argument.strides}")
        return argument.reshape(-1, order="A")
    return argument
