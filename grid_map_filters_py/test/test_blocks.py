# SPDX-License-Identifier: BSD-3-Clause
"""Layers computed block by block."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from grid_map_filters_py import WHOLE_MAP
from grid_map_filters_py.parts import blockwise

SIDES = st.integers(1, 40)


def sums_of_squares(layer, reach):
    """Return the sums over the square around every cell, as far as the layer goes."""
    rows, columns = layer.shape
    padded = np.pad(layer, reach)
    moves = np.ndindex(2 * reach + 1, 2 * reach + 1)
    return sum(padded[i : i + rows, j : j + columns] for i, j in moves)


@given(rows=SIDES, columns=SIDES, reach=st.integers(0, 3), cells=SIDES, side=SIDES)
def test_blocks_with_borders_equal_the_whole_layer(rows, columns, reach, cells, side):
    layer = np.arange(1.0, rows * columns + 1, dtype=np.float32).reshape(rows, columns, order="F")
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("CELLS", cells), ("_SIDE", side), ("_SHARE", 1)):
            patch.setattr(f"grid_map_filters_py.parts._blocks.{name}", value)
        found = blockwise(lambda block: sums_of_squares(block, reach), layer, reach=reach)
    np.testing.assert_array_equal(found, sums_of_squares(layer, reach))
    assert (found.dtype, found.flags.f_contiguous) == (np.float32, True)


@pytest.mark.parametrize(
    ("size", "reach", "sizes"),
    [
        ((1024, 384), 0, 3 * [(1024, 128)]),
        ((300, 400), 0, [(300, 400)]),
        ((500, 200), 2, [(252, 200), (252, 200)]),
        ((1000, 1200), 2, [(502, 402), (502, 404), (502, 402)] * 2),
        ((2000, 2000), 200, [(2000, 2000)]),
        ((2000, 2000), WHOLE_MAP, [(2000, 2000)]),
    ],
)
def test_blocks_are_large_and_even(size, reach, sizes):
    given_sizes = []

    def remember(block):
        given_sizes.append(block.shape)
        return block

    blockwise(remember, np.zeros(size, np.float32, order="F"), reach=reach)
    assert given_sizes == sizes


def test_several_layers_give_one():
    layers = [np.full((2000, 200), value, np.float32, order="F") for value in (1.0, 2.0, 4.0)]
    assert (blockwise(lambda *blocks: sum(blocks), *layers) == 7.0).all()
