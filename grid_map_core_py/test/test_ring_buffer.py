# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The circular buffer against a map that is simply copied."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grid_map_core_py import ring_buffer

sizes = st.tuples(st.integers(1, 9), st.integers(1, 9))


@given(sizes, st.data())
def test_wrap_and_unwrap_are_inverse(size, data):
    start = tuple(data.draw(st.integers(0, n - 1)) for n in size)
    cells = np.argwhere(np.ones(size))
    indices = ring_buffer.wrap(cells, start, size)
    np.testing.assert_array_equal(ring_buffer.unwrap(indices, start, size), cells)
    assert len(np.unique(indices, axis=0)) == len(cells)


@given(sizes, st.data())
def test_a_block_is_what_rolling_and_slicing_gives(size, data):
    start = tuple(data.draw(st.integers(0, n - 1)) for n in size)
    rows, columns = (
        slice(*sorted((data.draw(st.integers(0, n)), data.draw(st.integers(0, n))))) for n in size
    )
    layer = np.asfortranarray(np.arange(size[0] * size[1], dtype=np.float32).reshape(size))
    block = ring_buffer.block(layer, start, rows, columns)
    expected = np.roll(layer, (-start[0], -start[1]), axis=(0, 1))[rows, columns]
    np.testing.assert_array_equal(block, expected)
    assert block.flags.f_contiguous


@given(sizes, st.data())
def test_uncovered_regions_hold_exactly_the_cells_that_leave(size, data):
    start = tuple(data.draw(st.integers(0, n - 1)) for n in size)
    shift = tuple(data.draw(st.integers(-2 * n, 2 * n)) for n in size)
    uncovered = np.zeros(size, dtype=bool)
    for region in ring_buffer.uncovered(start, size, shift):
        uncovered[region.slices] = True
    expected = np.zeros(size, dtype=bool)
    for cell in np.argwhere(~expected):
        after = cell - shift
        expected[tuple(ring_buffer.wrap(cell, start, size))] = not (
            (after >= 0) & (after < size)
        ).all()
    np.testing.assert_array_equal(uncovered, expected)


@pytest.mark.parametrize("shift", [(8, 0), (0, -5), (9, 1), (1, 6), (-20, 20)])
def test_a_shift_by_the_whole_map_uncovers_everything_once(shift):
    regions = ring_buffer.uncovered((3, 2), (8, 5), shift)
    assert regions == [ring_buffer.BufferRegion((0, 0), (8, 5))]
