# SPDX-License-Identifier: BSD-3-Clause
"""The filter `Inpaint`, without and with limits for holes."""

import cv2
import numpy as np
import pytest
from filter_cases import filtered, ground
from hypothesis import assume, given, settings, strategies as st

from grid_map_core_py.testing import grid_maps
from grid_map_filters_py import FilterWarning
from grid_map_filters_py.parts._inpaint_loop import inpainted


def inpaint(grid_map, radius=0.3, **limits):
    return filtered("gridMapCv/InpaintFilter", grid_map, radius=radius, **limits)


@given(grid_maps(allow_moved=False))
@settings(max_examples=60)
def test_inpainting_fills_holes_and_keeps_finite_bits(grid_map):
    before = grid_map["elevation"]
    finite = np.isfinite(before)
    if not finite.any():
        with pytest.warns(FilterWarning, match="no finite cell"):
            np.testing.assert_array_equal(inpaint(grid_map), before)
        return
    filled = inpaint(grid_map)
    np.testing.assert_array_equal(filled[finite].view(np.uint32), before[finite].view(np.uint32))
    assert np.isfinite(filled).all()
    slack = 1e-5 * max(1.0, np.abs(before[finite]).max())
    assert filled.min() >= before[finite].min() - slack
    assert filled.max() <= before[finite].max() + slack


def test_ramp_continues_across_a_hole_without_quantization():
    ramp = np.tile(np.linspace(100.0, 110.0, 40, dtype=np.float32)[:, None], (1, 40))
    holed = ramp.copy()
    holed[15:25, 15:25] = np.nan
    filled = inpaint(ground(holed))
    assert np.abs(filled - ramp).max() < 1.0
    assert len(np.unique(filled[15:25, 15:25])) > 40


def test_extreme_ranges_stay_finite():
    heights = np.array([[-3e38, np.nan], [np.nan, 3e38], [1.0, np.inf]], dtype=np.float32)
    assert np.isfinite(inpaint(ground(heights))).all()


def ground_with_holes(size, share, seed):
    """Return heights with scattered holes and a large one."""
    random = np.random.default_rng(seed)
    heights = np.cumsum(random.normal(size=size), axis=0)
    holes = random.random(size) < share
    row, column = random.integers(0, size)
    holes[row : row + 9, column : column + 5] = True
    heights[holes] = random.choice([np.nan, np.inf, -np.inf])
    assume(not holes.all())
    return heights


@pytest.mark.needs("numba")
@pytest.mark.skipif(cv2.__version__ < "5", reason="OpenCV 4 fills cells at the border otherwise")
@given(
    st.tuples(st.integers(3, 40), st.integers(3, 40)),
    st.floats(0.0, 0.9),
    st.sampled_from([1.0, 2.5, 7.0]),
    st.integers(0, 1000),
)
@settings(max_examples=60)
def test_compiled_inpainting_agrees_with_opencv(size, share, radius, seed):
    heights = ground_with_holes(size, share, seed)
    missing = ~np.isfinite(heights)
    image = np.where(missing, 0.0, 30.0 * heights).astype(np.float32)
    expected = cv2.inpaint(image, missing.astype(np.uint8), radius, cv2.INPAINT_NS)
    np.testing.assert_allclose(inpainted(image, missing, radius), expected, rtol=1e-5, atol=1e-4)


SIZES = st.tuples(st.integers(1, 40), st.integers(1, 40))
SHARES = st.sampled_from([0.0, 0.1, 0.2, 0.45, 0.9])
SEEDS = st.integers(0, 2**32)


@given(SIZES, SHARES, st.sampled_from([0.02, 0.1, 0.3]), st.integers(2, 5), SEEDS)
def test_inpainting_by_strips_gives_the_same_bits(size, share, radius, strips, seed):
    grid_map = ground(ground_with_holes(size, share, seed))
    expected = inpaint(grid_map, radius)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("grid_map_filters_py._builtin._inpaint.thread_count", lambda: strips)
        found = inpaint(grid_map, radius)
    np.testing.assert_array_equal(found.view(np.uint32), expected.view(np.uint32))


# --- limits ---------------------------------------------------------------------------------------


def cells_of_hole(missing, start):
    """Return the cells of the hole around a cell, by a flood fill."""
    found, new = set(), [start]
    while new:
        row, column = new.pop()
        on_map = 0 <= row < missing.shape[0] and 0 <= column < missing.shape[1]
        if on_map and missing[row, column] and (row, column) not in found:
            found.add((row, column))
            new += [(row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    return found


@given(grid_maps(max_side=9, allow_moved=False), st.integers(0, 12), st.booleans())
@settings(max_examples=50)
def test_filled_holes_equal_a_flood_fill(grid_map, cells, enclosed):
    heights, area = grid_map["elevation"], cells * grid_map.resolution**2
    missing = ~np.isfinite(heights)
    if missing.all():
        return
    limits = {"max_hole_area": area} if cells else {}
    filled = inpaint(grid_map, enclosed_holes_only=enclosed, **limits)
    chosen = np.isfinite(filled) & missing
    np.testing.assert_array_equal(filled[chosen], inpaint(grid_map)[chosen])
    np.testing.assert_array_equal(filled[~chosen], heights[~chosen])
    for index in np.ndindex(missing.shape):
        hole = cells_of_hole(missing, index)
        last = np.subtract(missing.shape, 1)
        at_border = any(0 in cell or any(cell == last) for cell in hole)
        is_small = not cells or len(hole) <= cells
        expected = not missing[index] or (is_small and not (enclosed and at_border))
        assert np.isfinite(filled[index]) == expected
