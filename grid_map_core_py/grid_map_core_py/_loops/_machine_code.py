# SPDX-License-Identifier: BSD-3-Clause
"""Machine code: made by numba, loaded by llvmlite, which numba brings along.

Numba takes half a second to import, llvmlite a tenth of that. A compiled function becomes an object
file with one symbol that needs no others, so that it runs without numba.
"""

import ctypes
import functools
import importlib
import importlib.util
import math
import re
import types
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ._fingerprint import Function, global_names

Types: TypeAlias = tuple[str | tuple[str, int], ...]

_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
"""Options of numba: division by 0 gives an infinity or NaN."""

_SPARE = ctypes.create_string_buffer(16)
_RESULT, _EXCEPTION = (ctypes.addressof(_SPARE) + offset for offset in (0, 8))
"""Where compiled functions put their result, which is None, and the place of an exception."""

_engines: list[Any] = []
"""Owners of the machine code in memory."""

_NUMBERS = {
    "int32": (ctypes.c_int32, int),
    "int64": (ctypes.c_int64, int),
    "uint32": (ctypes.c_uint32, int),
    "float32": (ctypes.c_float, float),
    "float64": (ctypes.c_double, float),
}
"""Types of numbers in C, and how Python converts to them."""


class NotCompiledError(Exception):
    """Numba does not work, or refuses a function."""


class Compiled:
    """A compiled function in memory; takes what the function takes."""

    def __init__(self, address: int, takes: Types) -> None:
        kinds = [kind for part in takes for kind in _flat(part)]
        self._converters = [_converter(kind) for kind in kinds]
        c_types: Any = (ctypes.c_void_p if _is_array(kind) else _NUMBERS[kind][0] for kind in kinds)
        pointers = ctypes.c_void_p, ctypes.c_void_p
        self._function = ctypes.CFUNCTYPE(ctypes.c_int32, *pointers, *c_types)(address)

    def __call__(self, *arguments: Any) -> None:
        """Call the function, without Python's lock.

        Raises:
            TypeError: an array has another type or lies in pieces, or the number of arguments is
                wrong.
        """
        flat = [
            item
            for argument in arguments
            for item in (argument if isinstance(argument, tuple | list) else (argument,))
        ]
        if len(flat) != len(self._converters):
            raise TypeError(f"expected {len(self._converters)} arguments, got {len(flat)}")
        values = (convert(item) for convert, item in zip(self._converters, flat, strict=True))
        self._function(_RESULT, _EXCEPTION, *values)


def surroundings() -> tuple[str, ...] | None:
    """Return what machine code depends on besides functions; None if numba is not installed.

    Raises:
        NotCompiledError: numba or llvmlite do not work.
    """
    numba = importlib.util.find_spec("numba")
    if numba is None or numba.origin is None:
        return None
    try:
        version = Path(numba.origin).with_name("_version.py")
        if not version.exists():
            importlib.import_module("numba")  # is broken, and says how
        import llvmlite

        return version.read_text("utf-8"), llvmlite.__version__, np.__version__, *_machine()
    # A numba that was built for another NumPy, or lacks a library, raises SystemError,
    # AttributeError, OSError, ...
    except Exception as error:
        raise _unusable(error) from error


def compiled(
    function: Function, takes: Types, instead: Mapping[Function, Function], symbol: str
) -> bytes:
    """Return the object file of a function.

    Args:
        function: function to compile.
        takes: types of its arguments.
        instead: functions to compile in place of others.
        symbol: name of the function in the object file.

    Raises:
        NotCompiledError: numba does not work, or refuses the function.
    """
    try:
        import numba
    except Exception as error:
        raise _unusable(error) from error
    try:
        signature = numba.void(*(_numba_type(numba.types, part) for part in takes))
        made = numba.njit(signature, **_OPTIONS)(_ready(function, instead, numba.njit))
        (result,) = made.overloads.values()
        code = made.inspect_llvm(made.signatures[0])
        return _object_file(code, result.fndesc.llvm_func_name, symbol)
    except Exception as error:
        name = f"{function.__module__}.{function.__qualname__}"
        raise NotCompiledError(
            f"numba cannot compile {name}, NumPy does its work: {type(error).__name__}: {error}"
        ) from error


def loaded(code: bytes, symbol: str, takes: Types) -> Compiled:
    """Return the function in an object file.

    Its code stays in memory until the process ends.

    Raises:
        NotCompiledError: llvmlite does not work.
    """
    try:
        from llvmlite import binding

        # One engine for each: LLVM looks for some sections by name, and would find those of the
        # first object file in the engine.
        engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _target())
        engine.add_object_file(binding.ObjectFileRef.from_data(code))
        engine.finalize_object()
        address = engine.get_function_address(symbol)
    except Exception as error:
        raise _unusable(error) from error
    _engines.append(engine)
    return Compiled(address, takes)


def _unusable(error: Exception) -> NotCompiledError:
    return NotCompiledError(
        f"numba cannot be used, NumPy does its work: {type(error).__name__}: {error}"
    )


def _ready(function: Function, instead: Mapping[Function, Function], njit: Any) -> Function:
    """Return a copy of a function that calls compiled versions of the functions that it calls."""

    def compiled_part(value: Any) -> Any:
        if isinstance(value, types.FunctionType):
            return njit(error_model=_OPTIONS["error_model"])(_ready(value, instead, njit))
        return value

    function = instead.get(function, function)
    assert isinstance(function, types.FunctionType)
    known = function.__globals__
    names = global_names(function.__code__) & known.keys()
    copy = types.FunctionType(
        function.__code__,
        {"__name__": function.__module__, **{name: compiled_part(known[name]) for name in names}},
        function.__name__,
        function.__defaults__,
        tuple(
            types.CellType(compiled_part(cell.cell_contents)) for cell in function.__closure__ or ()
        ),
    )
    copy.__qualname__ = function.__qualname__
    return copy


def _object_file(code: str, name: str, symbol: str) -> bytes:
    """Return an object file with one function of a module in LLVM's language, and its parts."""
    from llvmlite import binding

    module = binding.parse_assembly(code)
    parts = {part.name: part for part in (*module.functions, *module.global_variables)}
    needed, new = {name}, [name]
    while new:
        named = set(re.findall(r'@"?([\w.$]+)', str(parts[new.pop()]))) & parts.keys()
        new += named - needed
        needed |= named
    for called, part in parts.items():
        if not part.is_declaration:
            part.linkage = "internal" if called in needed else "available_externally"
        # Functions of numba and Python are elsewhere in the next process.
        elif called in needed and not _is_everywhere(called):
            raise TypeError(f"it allocates memory or raises errors ({called})")
    parts[name].linkage = "external"
    parts[name].name = symbol
    made: bytes = _target().emit_object(module)
    return made


def _is_everywhere(name: str) -> bool:
    """Return whether LLVM or the C library has a function, such as `floorf`."""
    return name.startswith("llvm.") or hasattr(math, name) or hasattr(math, name.removesuffix("f"))


@functools.cache
def _machine() -> tuple[str, ...]:
    from llvmlite import binding

    features = binding.get_host_cpu_features().flatten()
    return binding.get_process_triple(), binding.get_host_cpu_name(), features


def _target() -> Any:
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    triple, cpu, features = _machine()
    # Absolute addresses, as numba has them, need no table of offsets.
    return binding.Target.from_triple(triple).create_target_machine(
        cpu=cpu, features=features, opt=3, reloc="static", codemodel="jitdefault", jit=True
    )


def _flat(part: str | tuple[str, int]) -> list[str]:
    return [part] if isinstance(part, str) else [part[0]] * part[1]


def _is_array(kind: str) -> bool:
    return kind.endswith("*")


def _converter(kind: str) -> Any:
    """Return a function that makes an argument in C."""
    if not _is_array(kind):
        return _NUMBERS[kind][1]
    dtype = np.dtype(kind.removesuffix("*"))

    def address(array: Any) -> int:
        if array.dtype != dtype or not array.flags.forc:
            raise TypeError(f"expected an array of {dtype} in one block, got {array.dtype}")
        number: int = array.ctypes.data
        return number

    return address


def _numba_type(known: Any, part: str | tuple[str, int]) -> Any:
    if not isinstance(part, str):
        return known.UniTuple(_numba_type(known, part[0]), part[1])
    number = getattr(known, part.removesuffix("*"))
    return known.CPointer(number) if _is_array(part) else number
