# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of interpolation between cell centers."""

import numpy as np
import pytest
from terrain import heights, terrain

from grid_map_core_py.map import Interpolation

POINTS = 100_000
ROWS = {
    Interpolation.NEAREST: "nearest",
    Interpolation.LINEAR: "linear",
    Interpolation.CUBIC_CONVOLUTION: "cubic_conv",
    Interpolation.CUBIC: "cubic",
}
# Error bounds: the slope over half a cell, and the curvature of the steepest waves in a cell.
ERRORS = {Interpolation.NEAREST: 0.03, Interpolation.LINEAR: 2e-3}


@pytest.mark.parametrize("holes", [True, False], ids=["5% NaN", "no NaN"])
@pytest.mark.parametrize("method", ROWS, ids=ROWS.values())
def test_interpolation(measure, cells, method, holes):
    grid_map = terrain(cells)
    if not holes:
        grid_map["elevation"] = heights(grid_map)
    spread = np.random.default_rng(1).uniform(-0.49, 0.49, (POINTS, 2))
    positions = grid_map.position + spread * grid_map.length
    row = f"atPosition x100k {ROWS[method]} ({'5% NaN' if holes else 'no NaN'})"
    values = measure(row, cells, lambda: grid_map.at_position("elevation", positions, method))
    expected = elevation(*positions.T)
    if not holes:
        np.testing.assert_allclose(values, expected, atol=ERRORS.get(method, 2e-4))
        return
    # A hole stays a hole, because interpolation falls back to the nearest cell.
    indices, _ = grid_map.get_indices(positions)
    known = np.isfinite(grid_map["elevation"][indices])
    np.testing.assert_array_equal(np.isfinite(values), known)
    np.testing.assert_allclose(values[known], expected[known], atol=ERRORS[Interpolation.NEAREST])


def elevation(x, y):
    """Return the terrain heights at coordinates."""
    return 0.3 * np.sin(1.3 * x) * np.cos(0.9 * y) + 0.05 * np.sin(7 * x + 3 * y)
