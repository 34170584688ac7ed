# SPDX-License-Identifier: BSD-3-Clause
"""The one place where functions are compiled, or loaded from disk."""

import hashlib
import os
import sys
import threading
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from . import _machine_code
from ._fingerprint import Function, described
from ._folder import is_writable, open_folder, read, write
from ._machine_code import Compiled, NotCompiledError, Types

_compiling = threading.RLock()
if hasattr(os, "register_at_fork"):
    # The child would wait forever for the locks of a compiler whose thread it does not have.
    os.register_at_fork(
        before=_compiling.acquire,
        after_in_parent=_compiling.release,
        after_in_child=_compiling.release,
    )


@dataclass(eq=False)
class Loop:
    """A function of flat arrays and numbers that can be compiled; for use through `loop`.

    Attributes:
        function: it indexes its arrays with integers from 0, writes its results into arrays, and
            returns nothing. It may use numbers, tuples, functions of NumPy and `math`, and
            functions like itself. It may neither allocate arrays nor raise errors. Python runs it,
            too, slowly.
        takes: types of the arguments: "float32*" for an array, "int64" for a number, and a type
            and a count for a tuple, as in ("float32*", 3).
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

    function: Function
    takes: Types
    instead: Mapping[Function, Function] = field(default_factory=dict)
    _found: Compiled | None = field(default=None, init=False)
    _has_tried: dict[bool, bool] = field(default_factory=dict, init=False)

    def compiled(self, *, always: bool = False) -> Compiled | None:
        """Return the compiled function, from disk or compiled now, which takes a second or two.

        It takes the arguments of the function. Arrays must lie in one block of memory; their types
        are checked, but not their lengths. Other threads run while it runs.

        Args:
            always: compile also where the machine code cannot be kept for later processes.

        Returns:
            None where numba is missing, is broken, refuses the function or is turned off by
            NUMBA_DISABLE_JIT, and where each process would compile anew. A `RuntimeWarning` names
            errors of numba.
        """
        if self._found is None and always not in self._has_tried:
            # Several threads may come here at once.
            with _compiling:
                if self._found is None and always not in self._has_tried:
                    self._found = self._find(always)
                    self._has_tried[always] = True
        return self._found

    def must_compile(self) -> bool:
        """Return whether `compiled` would compile now, because no machine code is on disk."""
        if self._has_tried or _is_turned_off():
            return False
        try:
            key = self._key()
        except NotCompiledError:
            return False
        with open_folder() as folder:
            if key is None or folder is None or not is_writable(folder):
                return False
            return read(folder, self._name(key), key) is None

    def _find(self, always: bool) -> Compiled | None:
        if _is_turned_off():
            return None
        try:
            key = self._key()
            return None if key is None else self._load(key, always)
        except NotCompiledError as error:
            warnings.warn(str(error), RuntimeWarning, stacklevel=4)
            return None

    def _key(self) -> bytes | None:
        """Return a digest of everything that machine code depends on; None without numba."""
        around = _machine_code.surroundings()
        if around is None:
            return None
        parts = (
            described(self.function, self.instead),
            self.takes,
            around,
            sys.version,
            Path(_machine_code.__file__).read_bytes(),
        )
        return hashlib.sha256(repr(parts).encode("utf-8", "backslashreplace")).digest()

    def _load(self, key: bytes, always: bool) -> Compiled | None:
        symbol, name = f"loop_{key.hex()[:32]}", self._name(key)
        with open_folder() as folder:
            code = None if folder is None else read(folder, name, key)
            if code is None:
                if not always and (folder is None or not is_writable(folder)):
                    return None
                code = _machine_code.compiled(self.function, self.takes, self.instead, symbol)
                if folder is not None:
                    write(folder, name, key, code)
        return _machine_code.loaded(code, symbol, self.takes)

    def _name(self, key: bytes) -> str:
        """Return the name of the file of the machine code."""
        return f"{self.function.__name__.strip('_')}-{key.hex()[:32]}"


def _is_turned_off() -> bool:
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"0", ""}


def loop(
    *takes: str | tuple[str, int], instead: Mapping[Function, Function] | None = None
) -> Callable[[Function], Loop]:
    """Return the decorator that makes a `Loop`, with the attributes of that class."""
    return lambda function: Loop(function, takes, instead or {})
