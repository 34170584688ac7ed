# SPDX-License-Identifier: BSD-3-Clause
"""The filter `Duplication`."""

from functools import partial

import numpy as np
from filter_cases import run, terrain

VALUES = np.array([[1.5, np.nan, -0.0], [np.inf, 1e-45, -3e38]], dtype=np.float32)


duplicate = partial(run, "gridMapFilters/DuplicationFilter", input_layer="elevation")


def test_copy_has_equal_bits_in_separate_memory():
    result = duplicate(terrain(VALUES.shape, elevation=VALUES), output_layer="copy")
    assert result.layers == ("elevation", "copy")
    for layer in result:
        np.testing.assert_array_equal(result[layer].view(np.uint32), VALUES.view(np.uint32))
    result["copy"][0, 0] = 7.0
    assert result["elevation"][0, 0] == 1.5


def test_copy_replaces_an_existing_layer():
    grid_map = terrain(VALUES.shape, other=1.0, elevation=VALUES)
    result = duplicate(grid_map, output_layer="other")
    assert result.layers == ("other", "elevation")
    np.testing.assert_array_equal(result["other"], VALUES)
    assert (grid_map["other"] == 1.0).all()
