# SPDX-License-Identifier: BSD-3-Clause
"""The filter `LightIntensity`."""

import filter_oracles as oracles
import numpy as np
import pytest
from filter_cases import run, terrain

from grid_map_filters_py import FilterConfigError


def test_light_is_brightest_at_normal_incidence():
    normals = {
        "n_x": [[0, 1, 0, 0.6, np.nan]],
        "n_y": [[0, 0, 0, 0, 0]],
        "n_z": [[1, 0, -1, 0.8, 1]],
    }
    grid_map = terrain((1, 5), **normals)
    params = {"input_layers_prefix": "n_", "output_layer": "color"}
    color = run("LightIntensity", grid_map, light_direction=[0, 0, -7], **params)["color"][0]
    expected = [(255,) * 3, (0,) * 3, (0,) * 3, (204,) * 3]
    assert [oracles.to_bytes(one) for one in color[:4]] == expected
    assert np.isnan(color[4])
    for direction in ([0, 0, 0], [1, 2], [0, 0, np.inf]):
        with pytest.raises(FilterConfigError, match="'light_direction': expected three finite"):
            run("LightIntensity", grid_map, light_direction=direction, **params)


@pytest.mark.parametrize("length", [1e-200, 1.0, 1e200])
def test_length_of_the_direction_does_not_matter(length):
    grid_map = terrain(n_x=0.0, n_y=0.6, n_z=0.8)
    params = {"input_layers_prefix": "n_", "output_layer": "out"}
    out = run("LightIntensity", grid_map, light_direction=[0.0, 0.0, -length], **params)["out"]
    assert (out.view(np.uint32) == 0x010101 * int(255 * 0.8)).all()
