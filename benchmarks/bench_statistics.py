# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of statistics and arithmetic on whole layers."""

import numpy as np
import pytest
from terrain import terrain

from grid_map_core_py import _arrays as statistics

REDUCTIONS = {
    "sumOfFinites": (statistics.sum_of_finites, np.nansum),
    "meanOfFinites": (statistics.mean_of_finites, np.nanmean),
    "numberOfFinites": (
        statistics.number_of_finites,
        lambda values: np.count_nonzero(np.isfinite(values)),
    ),
    "minCoeffOfFinites": (statistics.min_of_finites, np.nanmin),
}


@pytest.mark.parametrize("name", REDUCTIONS)
def test_reduction(measure, cells, name):
    layer = terrain(cells)["elevation"]
    function, oracle = REDUCTIONS[name]
    result = measure(f"matrix {name}", cells, lambda: function(layer))
    np.testing.assert_allclose(result, oracle(layer.astype(np.float64)), rtol=1e-6)


def test_layer_arithmetic(measure, cells):
    grid_map = terrain(cells)
    grid_map["elevation_smooth"] = 0.9 * grid_map["elevation"]

    def compute():
        grid_map["roughness"] = np.abs(grid_map["elevation"] - grid_map["elevation_smooth"])
        return grid_map["roughness"]

    row = "MathExpression abs(elevation - elevation_smooth)"
    result = measure(row, cells, compute)
    np.testing.assert_allclose(result, 0.1 * np.abs(grid_map["elevation"]), atol=1e-6)
