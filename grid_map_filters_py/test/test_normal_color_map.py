# SPDX-License-Identifier: BSD-3-Clause
"""The filter `NormalColorMap`."""

import numpy as np
from filter_cases import run, terrain

from grid_map_core_py import color_value_to_vector


def test_axes_become_red_green_and_blue():
    grid_map = terrain((3, 1), n_x=[[1], [0], [np.nan]], n_y=[[-1], [0], [0]], n_z=[[0], [1], [0]])
    params = {"input_layers_prefix": "n_", "output_layer": "color"}
    color = run("gridMapFilters/NormalColorMapFilter", grid_map, **params)["color"]
    rgb = color_value_to_vector(color)[:, 0]
    np.testing.assert_allclose(rgb[0], [1, 0, 127 / 255], atol=1e-6)
    np.testing.assert_allclose(rgb[1], [127 / 255, 127 / 255, 1], atol=1e-6)
    assert np.isnan(rgb[2]).all()
