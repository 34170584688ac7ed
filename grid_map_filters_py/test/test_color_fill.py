# SPDX-License-Identifier: BSD-3-Clause
"""The filter `ColorFill`."""

import filter_oracles as oracles
import numpy as np
import pytest
from filter_cases import run, terrain

from grid_map_filters_py import FilterConfigError


def test_color_fills_all_cells_or_finite_cells_of_mask():
    grid_map = terrain((1, 4), mask=[[1, np.nan, np.inf, -3]])
    params = {"red": 0.2, "green": 2, "blue": -1, "output_layer": "color"}
    everywhere = run("ColorFill", grid_map, **params)["color"]
    assert {oracles.to_bytes(color) for color in everywhere.flat} == {(51, 255, 0)}
    masked = run("ColorFill", grid_map, mask_layer="mask", **params)["color"][0]
    np.testing.assert_array_equal(np.isnan(masked), [False, True, True, False])
    assert {oracles.to_bytes(color) for color in masked[[0, 3]]} == {(51, 255, 0)}
    with pytest.raises(FilterConfigError, match="'red, green, blue': expected three finite"):
        run("ColorFill", grid_map, **params | {"red": np.nan})


def test_channel_beyond_single_precision_is_clamped():
    out = run("ColorFill", terrain(), red=1e300, green=-1e300, blue=0, output_layer="out")["out"]
    assert (out.view(np.uint32) == 0xFF0000).all()
