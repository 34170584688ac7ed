# SPDX-License-Identifier: BSD-3-Clause
"""The filter `SetBasicLayers`."""

import pytest
from filter_cases import run, terrain

from grid_map_filters_py import FilterConfigError, FilterWarning


def test_missing_basic_layers_are_a_warning():
    grid_map = terrain(a=1.0, b=2.0, c=3.0)
    grid_map.basic_layers = ["c"]
    for name in ("layers", "layer"):
        with pytest.warns(FilterWarning, match="no layer nope to be basic; available: a, b, c"):
            result = run("SetBasicLayers", grid_map, **{name: ["b", "nope", "a"]})
        assert result.basic_layers == ("b", "a")
    assert run("SetBasicLayers", grid_map, layers=None).basic_layers == ()
    for params in ({}, {"layers": ["a"], "layer": ["b"]}):
        with pytest.raises(FilterConfigError, match="expected either 'layers' or 'layer'"):
            run("SetBasicLayers", grid_map, **params)
