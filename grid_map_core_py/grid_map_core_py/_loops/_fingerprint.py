# SPDX-License-Identifier: BSD-3-Clause
"""Everything that a function is made of: itself, what it calls, and the values that it reads."""

import dis
import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeAlias

import numpy as np

Function: TypeAlias = Callable[..., Any]

_LIBRARIES = ("builtins", "math", "numpy")
"""Modules whose functions a loop may use; their versions belong to the key of machine code."""


def global_names(code: types.CodeType) -> set[str]:
    """Return the names that code, and code within it, looks up in its module."""
    found = {step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"}
    return found.union(*(global_names(inner) for inner in _inner(code)))


def described(value: Any, instead: Mapping[Function, Function]) -> Any:
    """Return nested tuples of texts and bytes that differ where compiled code would differ.

    Args:
        value: a function, with all that it reads and calls, or a value that it reads.
        instead: functions that take the place of others.

    Raises:
        TypeError: a function reads a value that may change later, such as a list.
    """
    if isinstance(value, types.FunctionType):
        function = instead.get(value, value)
        cells = [cell.cell_contents for cell in function.__closure__ or ()]
        return (
            _described_code(function.__code__),
            described((function.__defaults__ or (), *cells), instead),
            *(
                (name, described(function.__globals__[name], instead))
                for name in sorted(global_names(function.__code__))
                if name in function.__globals__
            ),
        )
    if isinstance(value, tuple):
        return "tuple", *(described(item, instead) for item in value)
    if isinstance(value, np.generic):
        return value.dtype.str, value.tobytes()
    if value is None or isinstance(value, bool | int | float | str | bytes):
        return type(value).__name__, repr(value)
    module = value if isinstance(value, types.ModuleType) else None
    home = module.__name__ if module else getattr(value, "__module__", None)
    if isinstance(value, np.ufunc) or (home or "").partition(".")[0] in _LIBRARIES:
        return "library", home, getattr(value, "__name__", repr(value))
    raise TypeError(f"a loop cannot use {value!r}: expected a number, a tuple or a function")


def _described_code(code: types.CodeType) -> Any:
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    constants = tuple(
        sorted(map(repr, constant)) if isinstance(constant, frozenset) else repr(constant)
        for constant in code.co_consts
        if not isinstance(constant, types.CodeType)
    )
    inner = tuple(map(_described_code, _inner(code)))
    return code.co_code, counts, names, constants, inner


def _inner(code: types.CodeType) -> Iterator[types.CodeType]:
    return (constant for constant in code.co_consts if isinstance(constant, types.CodeType))
