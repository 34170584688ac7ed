# SPDX-License-Identifier: BSD-3-Clause
"""The filter `Deletion`."""

import pytest
from filter_cases import run, terrain

from grid_map_filters_py import FilterWarning


def test_deleting_a_missing_layer_is_a_warning():
    grid_map = terrain(a=1.0, b=2.0)
    grid_map.basic_layers = ["a"]
    with pytest.warns(FilterWarning, match=r"filter 1 'under_test'.*no layer nope to delete"):
        result = run("gridMapFilters/DeletionFilter", grid_map, layers=["a", "nope"])
    assert result.layers == ("b",)
    assert result.basic_layers == ()
