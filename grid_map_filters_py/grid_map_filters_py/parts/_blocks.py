# SPDX-License-Identifier: BSD-3-Clause
"""Layers computed block by block, in the threads of the chain.

The temporaries of a block are in the cache, and the new layer is the only large array. The blocks
depend on the size of the map and on the reach, not on the number of threads.
"""

import math
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer, Size, slices

from ._side_by_side import CELLS, side_by_side

_SIDE = 512
"""Largest side of a block with a border, unless the border is wide; half of it on small maps."""

_SMALL = 2**20
"""Cells of a map that is not small. On smaller ones the C library gives back large temporaries."""

_SHARE = 32
"""Least side of a block in widths of its border, which is computed twice."""


class _Block(NamedTuple):
    """A rectangle of cells, with the border that a filter looks at.

    Args:
        cells: rows and columns.
        around: the same with the border, as far as the map goes.
    """

    cells: tuple[slice, slice]
    around: tuple[slice, slice]

    @property
    def inner(self) -> tuple[slice, ...]:
        """The cells within those of `around`."""
        return tuple(
            slice(cells.start - around.start, cells.stop - around.start)
            for cells, around in zip(self.cells, self.around, strict=True)
        )


def blockwise(function: Callable[..., npt.NDArray[Any]], *layers: Layer, reach: float = 0) -> Layer:
    """Return the layer `function(*layers)`, computed block by block in the threads of the chain.

    Args:
        function: takes blocks of the layers, which are views of them, and returns an array of their
            shape. A cell of it depends on the cells of the layers that are at most `reach` rows and
            columns away.
        layers: (rows, cols) in map order, of one shape.
        reach: whole number of cells; `WHOLE_MAP` calls the function once, with the layers.

    Returns:
        (rows, cols) float32 in Fortran order.
    """
    size = layers[0].shape
    blocks = list(_blocks((size[0], size[1]), reach))
    if len(blocks) < 2:
        return np.asarray(function(*layers), np.float32, order="F")
    result = np.empty(size, np.float32, order="F")

    def compute(block: _Block) -> None:
        values = function(*(layer[block.around] for layer in layers))
        result[block.cells] = values[block.inner]

    side_by_side(compute, blocks)
    return result


def _blocks(size: Size, reach: float) -> Iterator[_Block]:
    """Yield blocks of about equal size; one block if `reach` is most of the map."""
    border = int(min(reach, max(size)))
    # Whole columns are one piece of memory.
    side = _SIDE if size[0] * size[1] >= _SMALL else _SIDE // 2
    longest = max(side, _SHARE * border) if border else size[0]
    rows = _evenly(size[0], longest)
    columns = _evenly(size[1], longest if border else CELLS // rows)
    for cells in product(slices(size[0], rows), slices(size[1], columns)):
        around = tuple(
            slice(max(part.start - border, 0), min(part.stop + border, length))
            for part, length in zip(cells, size, strict=True)
        )
        yield _Block(cells, (around[0], around[1]))


def _evenly(length: int, longest: int) -> int:
    """Return the length of equal parts that are not longer than `longest`."""
    return math.ceil(length / math.ceil(length / max(longest, 1)))
