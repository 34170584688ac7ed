# SPDX-License-Identifier: BSD-3-Clause
"""Array types, argument checks, piecewise computation, memory reuse and statistics."""

from ._checks import (
    Cells as Cells,
    Layer as Layer,
    Mask as Mask,
    Positions as Positions,
    Size as Size,
    as_array as as_array,
    as_number as as_number,
)
from ._freed_memory import LARGEST_BLOCK as LARGEST_BLOCK, keep_memory as keep_memory
from ._pieces import elementwise as elementwise, slices as slices
from ._statistics import (
    max_of_finites as max_of_finites,
    mean_of_finites as mean_of_finites,
    min_of_finites as min_of_finites,
    number_of_finites as number_of_finites,
    sum_of_finites as sum_of_finites,
)

__all__ = [name for name in dir() if not name.startswith("_")]
