# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Parts for writing fast filters: sums over discs, and functions of single cells.

`Disc` and `tiles` sum up the values in the disc around every cell. `cell_function` turns a function
of the values of one cell into one of whole layers, which numba compiles where it is installed.
"""

from ._cell_function import (
    CellFunction as CellFunction,
    cell_function as cell_function,
    choose as choose,
    clamp as clamp,
    helper as helper,
    is_finite as is_finite,
)
from ._disc import Disc as Disc, Tile as Tile, tiles as tiles, typical_value as typical_value

__all__ = [name for name in dir() if not name.startswith("_")]
