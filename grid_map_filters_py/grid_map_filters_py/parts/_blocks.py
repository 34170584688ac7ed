# SPDX-License-Identifier: BSD-3-Clause
"""Layers computed block by block, in the threads of the chain.

The temporaries of a block are in the cache, and the new layer is the only large array. The blocks
depend on the size of the map and on the reach, not on the number of threads.
"""

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer, Size, slices

from ._side_by_side import CELLS, side_by_side

Block = tuple[tuple[slice, slice], tuple[slice, slice]]
"""Rows and columns of a block without its border, and with its border."""

_SIDE = 512
"""Largest side of a block with a border, unless the border is wide; half of it on small maps."""

_SMALL = 2**20
"""Number of cells below which a map is small."""

_SHARE = 16
"""Minimum side of a block in widths of its border, which is computed twice."""


def blockwise(
    function: Callable[..., npt.NDArray[Any]],
    *layers: Layer,
    reach: float = 0,
    side: int | None = None,
) -> Layer:
    """Return the layer `function(*layers)`, computed block by block in the threads of the chain.

    Args:
        function: takes blocks of the layers, which are views of them, and returns an array of their
            shape. A cell of it depends on the cells of the layers that are at most `reach` rows and
            columns away.
        layers: (rows, cols) in map order, of one shape.
        reach: whole number of cells; `WHOLE_MAP` calls the function once, with the layers.
        side: largest side of a block [cells], without the border; about 500 by default. Blocks are
            larger if `reach` is large.

    Returns:
        (rows, cols) float32 in Fortran order.
    """
    size = layers[0].shape
    blocks = blocks_of((size[0], size[1]), reach, side)
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
    """Write the layers that `function(*layers)` returns into `results`, block by block."""

    def compute(block: Block) -> None:
        cells, around = block
        inner = tuple(
            slice(own.start - wide.start, own.stop - wide.start)
            for own, wide in zip(cells, around, strict=True)
        )
        values = function(*(layer[around] for layer in layers))
        for result, found in zip(results, values, strict=True):
            result[cells] = found[inner]

    side_by_side(compute, blocks)


def blocks_of(size: Size, reach: float, side: int | None) -> list[Block]:
    """Return blocks of about equal size; one block if `reach` is most of the map.

    Args:
        size: rows and columns of the map.
        reach: width of the border [cells].
        side: largest side of a block [cells], or None.
    """
    border = int(min(reach, max(size)))
    if side is None:
        side = _SIDE if size[0] * size[1] >= _SMALL else _SIDE // 2
    # Without a border, whole columns are one piece of memory.
    longest = max(side, _SHARE * border)
    limits = (longest, longest) if border else (size[0], CELLS // size[0])
    sides = [
        math.ceil(length / math.ceil(length / max(limit, 1)))
        for length, limit in zip(size, limits, strict=True)
    ]

    def widened(cells: slice, length: int) -> slice:
        return slice(max(cells.start - border, 0), min(cells.stop + border, length))

    return [
        ((rows, columns), (widened(rows, size[0]), widened(columns, size[1])))
        for rows, columns in product(slices(size[0], sides[0]), slices(size[1], sides[1]))
    ]
