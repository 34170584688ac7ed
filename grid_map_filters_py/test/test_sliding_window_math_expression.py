# SPDX-License-Identifier: BSD-3-Clause
"""The filter `SlidingWindowMathExpression`; `test_expression_windows.py` tests its results."""

import numpy as np
import pytest
from filter_cases import run, terrain


def over_windows(grid_map, expression, **params):
    params |= {"input_layer": "a", "output_layer": "out", "edge_handling": "crop"}
    type_name = "gridMapFilters/SlidingWindowMathExpressionFilter"
    return run(type_name, grid_map, expression=expression, **params)["out"]


@pytest.mark.parametrize(
    ("length", "cells"), [(0.05, 1), (0.3, 3), (0.16, 3), (0.24, 3), (0.25, 3), (0.36, 5)]
)
def test_window_length_is_rounded_to_an_odd_number(length, cells):
    grid_map = terrain((11, 9), a=1.0)
    counts = over_windows(grid_map, "numberOfFinites(a)", window_length=length)
    assert counts[5, 4] == cells**2


def test_empty_cells_stay_empty_on_request():
    grid_map = terrain((3, 3), a=[[1, 1, 1], [1, np.nan, 1], [1, 1, 1]])
    assert over_windows(grid_map, "sumOfFinites(a)", compute_empty_cells=True)[1, 1] == 8
    assert np.isnan(over_windows(grid_map, "sumOfFinites(a)", compute_empty_cells=False)[1, 1])
