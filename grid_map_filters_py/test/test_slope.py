# SPDX-License-Identifier: BSD-3-Clause
"""The filter `Slope`, against planes and normals of known slope."""

from functools import partial

import numpy as np
import pytest
from filter_cases import filtered, run, terrain
from hypothesis import given, settings, strategies as st

from grid_map_filters_py import FilterConfigError

SLOPE = "gridMapFilters/SlopeFilter"
slope = partial(filtered, SLOPE)


@pytest.mark.parametrize("radius", [0.0, 0.25])
@given(st.tuples(st.floats(-10, 10), st.floats(-10, 10)))
@settings(max_examples=20)
def test_the_slope_of_a_plane_is_its_angle(radius, gradient):
    grid_map = terrain((9, 7))
    x, y = grid_map.get_positions().T
    z = gradient[0] * x + gradient[1] * y
    grid_map["elevation"] = z.reshape(grid_map.size, order="F")
    angles = slope(grid_map, radius=radius)[2:-2, 2:-2]
    np.testing.assert_allclose(angles, np.arctan(np.hypot(*gradient)), atol=2e-5)


def test_gentle_slopes_keep_precision():
    grid_map = terrain((20, 20))
    grid_map["elevation"] = 1e-4 * grid_map.get_positions()[:, 0].reshape(20, 20, order="F")
    for radius in (0.0, 0.2):
        np.testing.assert_allclose(slope(grid_map, radius=radius)[5, 5], 1e-4, rtol=1e-3)


def test_length_and_sign_of_normals_do_not_matter():
    normals = {"n_x": [[0.0, 3.0, 0.0, np.nan]], "n_y": [[0, 0, -1, 0]], "n_z": [[2, 3, 0, 1]]}
    grid_map = terrain((1, 4), **normals)
    expected = [[0.0, np.pi / 4, np.pi / 2, np.nan]]
    params = {"input_layers_prefix": "n_", "output_layer": "out"}
    for sign in (1, -1):
        grid_map["n_z"] = sign * np.array(normals["n_z"])
        np.testing.assert_allclose(run(SLOPE, grid_map, **params)["out"], expected, rtol=1e-6)
    with pytest.raises(FilterConfigError, match="no 'radius' beside 'input_layers_prefix'"):
        run(SLOPE, grid_map, radius=0.1, **params)
