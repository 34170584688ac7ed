# SPDX-License-Identifier: BSD-3-Clause
"""Computes layers block by block in the threads of the chain.

The temporary arrays of a block fit into the cache. The blocks are the same for all thread counts.
"""

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer, Size, slices
from grid_map_core_py.tiled._source import Window, widened, within

from ._side_by_side import CELLS, side_by_side

Block = tuple[Window, Window]
"""Cells of a block without its border, and with the border."""

_SIDE = 512
"""Maximum side of blocks with a narrow border [cells]; in small maps, half of this value."""

_SMALL = 2**20
"""Number of cells below which a map is small."""

_SHARE = 16
"""Maximum side of blocks with a wide border [border widths]; border cells are computed twice."""


def blockwise(function: Callable[..., npt.NDArray[Any]], *layers: Layer, reach: float = 0) -> Layer:
    """Compute the layer `function(*layers)` block by block in the threads of the chain.

    Args:
        function: called with blocks (views) of the layers; returns an array of the same shape. A
            cell of the result must depend only on cells that are at most `reach` rows and columns
            away.
        layers: (rows, cols) arrays of equal shape in map order.
        reach: reach of `function` [cells]; if `WHOLE_MAP`, whole layers are passed in one call.

    Returns:
        (rows, cols) float32 in Fortran order.
    """
    size = layers[0].shape
    blocks = blocks_of((size[0], size[1]), reach)
    if len(blocks) < 2:
        return np.asarray(function(*layers), np.float32, order="F")
    result = np.empty(size, np.float32, order="F")
    fill_blocks((result,), lambda *parts: (function(*parts),), layers, blocks)
    return result


def fill_blocks(
    results: Sequence[Layer],
    function: Callable[..., Sequence[npt.NDArray[Any]]],
    layers: Sequence[Layer],
    blocks: Sequence[Block],
) -> None:
    """Compute the layers `function(*layers)` block by block, and write them to `results`."""

    def compute(block: Block) -> None:
        cells, around = block
        values = function(*(layer[around] for layer in layers))
        for result, found in zip(results, values, strict=True):
            result[cells] = found[within(cells, around)]

    side_by_side(compute, blocks)


def blocks_of(size: Size, reach: float) -> list[Block]:
    """Divide a map into blocks of about equal size, with borders of `reach` cells."""
    border = int(min(reach, max(size)))
    side = _SIDE if size[0] * size[1] >= _SMALL else _SIDE // 2
    # Without a border, blocks of whole columns are contiguous in memory.
    longest = max(side, _SHARE * border)
    limits = (longest, longest) if border else (size[0], CELLS // size[0])
    sides = [
        math.ceil(length / math.ceil(length / max(limit, 1)))
        for length, limit in zip(size, limits, strict=True)
    ]
    blocks = product(slices(size[0], sides[0]), slices(size[1], sides[1]))
    return [(block, widened(block, border, size)) for block in blocks]
