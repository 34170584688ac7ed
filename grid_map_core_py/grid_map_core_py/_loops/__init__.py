# SPDX-License-Identifier: BSD-3-Clause
"""Loops over cells or points, compiled where numba is installed.

`loop` makes a `Loop` of a function of flat arrays and numbers. Numba compiles it to machine code,
which is kept on disk: later processes load it in milliseconds, without importing numba.
"""

from ._loop import Loop as Loop, loop as loop
from ._machine_code import Compiled as Compiled

__all__ = [name for name in dir() if not name.startswith("_")]
