# SPDX-License-Identifier: BSD-3-Clause
"""Helpers for fast filters: sums over discs, cellwise functions, blocks and threads.

`Disc` sums the values in the disc around every cell. `cell_function` applies a function to each
cell, and compiles it if numba is installed. `blockwise` computes a layer block by block in the
threads of the chain. `side_by_side` runs other work in these threads.
"""

from grid_map_core_py import _lazy

from ._blocks import blockwise as blockwise
from ._cell_function import (
    cell_function as cell_function,
    choose as choose,
    clamp as clamp,
    is_finite as is_finite,
)
from ._disc import Disc as Disc, disc_reach as disc_reach, typical_value as typical_value
from ._side_by_side import side_by_side as side_by_side

__all__, __dir__ = _lazy.public_names(dir())
