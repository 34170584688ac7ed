# SPDX-License-Identifier: BSD-3-Clause
"""Loops over cells or points, compiled with numba if numba is installed.

The first use of a loop imports numba, which caches the machine code.
"""

import importlib.util
import inspect
import logging
import os
import threading
import types
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

Compiled: TypeAlias = Callable[..., None]
Type: TypeAlias = str | tuple[str, int] | tuple[str, ...]

logger = logging.getLogger(__name__)
_compiling = threading.RLock()
_known: set[Callable[..., Any]] = set()
"""Functions that are registered with numba, so that compiled code can call them."""


@dataclass(eq=False)
class Loop:
    """Function that numba can compile, with flat arrays and numbers as arguments.

    Attributes:
        function: writes results to arrays and returns nothing. Array indices must not be negative.
        takes: argument types: "float32*" for an array, "const float32*" for a read-only array,
            "int64" for a number, and ("float32*", 3) or ("int64", "float32*") for a tuple.
            The first call with other types compiles the loop again.
        instead: functions that compiled code replaces, and their replacements.
    """

    function: Callable[..., None]
    takes: tuple[Type, ...]
    instead: Mapping[Callable[..., Any], Callable[..., Any]] = field(default_factory=dict)

    def compiled(self) -> Compiled | None:
        """Return the compiled function, or None if numba is missing, disabled or fails.

        Array arguments must be contiguous. The compiled function releases the GIL.
        """
        with _compiling:
            return self._compiled

    @cached_property
    def _compiled(self) -> Compiled | None:
        failure = None
        is_on = os.environ.get("NUMBA_DISABLE_JIT", "0") in {"0", ""}
        has_numba = is_on and importlib.util.find_spec("numba") is not None
        # Numba raises an error if it finds no writable folder for its cache.
        for cache in (True, False) if has_numba else ():
            try:
                njit: Any = importlib.import_module("numba").njit
                _let_call(self.function, self.instead)
                dispatcher = njit(nogil=True, error_model="numpy", cache=cache)(self.function)
                folder = dispatcher.stats.cache_path
                files = f"*.{self.function.__qualname__}-*.nbi"
                if folder is None or not any(Path(folder).glob(files)):
                    _announce()
                known = importlib.import_module("numba.types")
                dispatcher.compile(tuple(_numba_type(known, part) for part in self.takes))
            except Exception as error:
                failure = error
            else:
                return lambda *arguments: dispatcher(*map(_flat, arguments))
        if failure is not None:
            name = f"{self.function.__module__}.{self.function.__qualname__}"
            text = f"{type(failure).__name__}: {failure}"
            said = f"numba cannot compile {name}, so NumPy is used: {text}"
            warnings.warn(said, RuntimeWarning, stacklevel=3)
        return None


def loop(*takes: Type) -> Callable[[Callable[..., None]], Loop]:
    """Return a decorator that turns a function into a `Loop` with these argument types."""
    return lambda function: Loop(function, takes)


@lru_cache
def _announce() -> None:
    # Logged rather than warned, because programs may turn warnings into errors.
    logger.warning("numba compiles loops once, which takes some seconds")


def _let_call(
    function: Callable[..., Any], instead: Mapping[Callable[..., Any], Callable[..., Any]]
) -> None:
    """Register the called functions with numba, so that compiled code can call them."""
    from numba.extending import overload

    names = inspect.getclosurevars(function)
    for called in (*names.globals.values(), *names.nonlocals.values()):
        if isinstance(called, types.FunctionType) and called not in _known:
            _known.add(called)
            made = instead.get(called, called)
            options: Any = {"error_model": "numpy"}
            overload(called, jit_options=options, strict=False)(lambda *_, made=made: made)
            _let_call(made, instead)


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
