# SPDX-License-Identifier: BSD-3-Clause
"""Visualizations built from parameter files."""

import math
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import grid_map_visualization_py
from grid_map_core_py import GridMap
from grid_map_core_py.errors import ConfigError, LayerNotFoundError
from grid_map_visualization_py import VISUALIZATIONS, _registry as registry, create
from grid_map_visualization_py._builtin import MapRegionVisualization

INF = math.inf
VECTORS = {"layer_prefix": "n_", "position_layer": "z"}


def test_misspelled_parameter_of_a_class_gets_a_suggestion():
    with pytest.raises(ConfigError, match=r"unknown parameter 'scal'; .*; did you mean scale"):
        VISUALIZATIONS["vectors"](**VECTORS, scal=2.0)


@pytest.mark.parametrize(
    ("type_name", "params", "defaults"),
    [
        ("point_cloud", {}, {"layer": "elevation", "flat": False}),
        ("flat_point_cloud", {"height": 2}, {}),
        ("occupancy_grid", {"layer": "a"}, {"data_min": 0.0, "data_max": 1.0}),
        ("occupancy_grid", {"layer": "a", "data_min": 5, "data_max": -1}, {}),
        ("grid_cells", {"layer": "a"}, {"lower_threshold": -INF, "upper_threshold": INF}),
        ("vectors", VECTORS, {"scale": 1.0, "line_width": 0.003, "color": 65280}),
        ("vectors", {**VECTORS, "scale": 2, "line_width": 1, "color": 255.0}, {}),
        ("map_region", {}, {"color": 16777215, "line_width": 0.003}),
        ("surface", {}, {"height_layer": "elevation", "color_mode": "intensity", "opacity": 1.0}),
        ("surface", {"color_mode": "flat", "color": 255, "lower": -1, "max_drawn_cells": 9.0}, {}),
        ("image", {"layer": "a"}, {"color_map": "viridis", "encoding": "rgb8"}),
        ("contours", {"layer": "a"}, {"interval": 0.1, "levels": ()}),
        ("contours", {"layer": "a", "interval": 2, "levels": (1.0, 2.0)}, {}),
    ],
)
def test_parameters_and_defaults_become_fields_of_their_type(type_name, params, defaults):
    made = create("name", {"type": type_name, "params": params})
    assert type(made) is VISUALIZATIONS[type_name]
    kinds = {"data_min": float, "data_max": float, "color": int, "max_drawn_cells": int}
    for name, value in (params | defaults).items():
        assert getattr(made, name) == value
        assert isinstance(getattr(made, name), kinds.get(name, object))


@pytest.mark.parametrize("config", [{"type": "map_region"}, {"type": "map_region", "params": None}])
def test_parameters_may_be_left_out(config):
    assert create("a", config) == MapRegionVisualization()


def missing_words(config: dict[str, object], words: str) -> list[str]:
    """Return those words that the error about a visualization lacks."""
    with pytest.raises(ConfigError) as caught:
        create("my_output", config)
    assert "\n" not in str(caught.value)
    every = ["visualization 'my_output'", *words.split("; ")]
    return [word for word in every if word not in str(caught.value)]


@pytest.mark.parametrize(
    ("config", "words"),
    [
        ({}, "type; expected one of; vectors; got nothing"),
        ({"type": 3}, "type; got 3"),
        ({"type": "vector"}, "'vector'; unknown type; did you mean vectors?"),
        ({"type": "vectors", "parms": {}}, "'parms'; type and params"),
        ({"type": "map_region", "params": 1}, "params; got 1"),
        ({"type": "vectors"}, "vectors; missing; 'layer_prefix'"),
    ],
)
def test_wrong_entry_of_a_visualization_is_one_error(config, words):
    assert missing_words(config, words) == []


@pytest.mark.parametrize(
    ("type_name", "params", "words"),
    [
        ("map_region", {"width": 1}, "'width'; color, line_width"),
        ("map_region", {"color": "red"}, "'color'; integer; 'red'"),
        ("map_region", {"color": -1}, "'color'; 16777215; -1"),
        ("map_region", {"color": 2**24}, "'color'; 16777216"),
        ("point_cloud", {"layer": 1}, "'layer'; string; 1"),
        ("flat_point_cloud", {"height": math.nan}, "'height'; nan"),
        ("map_region", {"line_width": 0}, "'line_width'; 0.0"),
        ("vectors", {**VECTORS, "line_width": math.inf}, "'line_width'; inf"),
        ("vectors", {**VECTORS, "scale": math.nan}, "'scale'; nan"),
        ("grid_cells", {"layer": "a", "upper_threshold": math.nan}, "lower_threshold (-inf); nan"),
        ("surface", {"color_mode": "rainbow"}, "'color_mode'; 'intensity'"),
        ("surface", {"color_map": "virids"}, "'color_map'; mean viridis"),
        ("surface", {"opacity": 1.5}, "'opacity'; 0 to 1; 1.5"),
        ("surface", {"color": -1}, "'color'; 16777215; -1"),
        ("surface", {"max_drawn_cells": 8}, "'max_drawn_cells'; at least 9; 8"),
        ("surface", {"lower": 2, "upper": 1}, "'upper'; lower (2.0); 1.0"),
        ("image", {}, "missing; 'layer'"),
        ("image", {"layer": "a", "encoding": "mono8"}, "'encoding'; 'bgra8'"),
        ("image", {"layer": "a", "lower": math.inf}, "'lower'; inf"),
        ("contours", {"layer": "a", "interval": 0}, "'interval'; 0.0"),
        ("contours", {"layer": "a", "levels": [math.nan]}, "'levels'; nan"),
        ("contours", {"layer": "a", "levels": 3}, "'levels'; a list; 3"),
        ("contours", {"layer": "a", "line_width": -1}, "'line_width'; -1.0"),
        ("occupancy_grid", {"layer": "a", "data_min": 1}, "data_min, data_max; different; 1.0"),
        ("occupancy_grid", {"layer": "a", "data_max": math.inf}, "data_min, data_max; inf"),
    ],
)
def test_wrong_parameter_is_one_error_that_names_it(type_name, params, words):
    config = {"type": type_name, "params": params}
    assert missing_words(config, f"'{type_name}'; {words}") == []


@pytest.mark.parametrize(
    ("type_name", "params"),
    [
        ("vectors", VECTORS | {"layer_prefix": "m_"}),
        ("vectors", VECTORS | {"position_layer": "b"}),
        ("surface", {"height_layer": "b"}),
        ("surface", {"height_layer": "z", "color_layer": "b"}),
        ("image", {"layer": "b"}),
        ("contours", {"layer": "b"}),
        ("point_cloud", {"layer": "b"}),
        ("occupancy_grid", {"layer": "b"}),
        ("grid_cells", {"layer": "b"}),
    ],
)
def test_missing_layer_is_named_beside_existing_ones(type_name, params):
    layers = ["z", "n_x", "n_y", "n_z", "m_x", "m_y"]
    grid_map = GridMap((2, 2), 1.0, layers=dict.fromkeys(layers, 0.0))
    with pytest.raises(LayerNotFoundError, match=r"no layer '(b|m_z)'; available: z, n_x"):
        create("a", {"type": type_name, "params": params})(grid_map)


def test_example_file_has_every_built_in_type():
    path = Path(__file__).parents[1] / "config" / "grid_map_visualization.yaml"
    parameters = yaml.safe_load(path.read_text())["grid_map_visualization"]["ros__parameters"]
    names = parameters["grid_map_visualizations"]
    made = {type(create(name, parameters[name])) for name in names}
    assert made == {*registry.BUILT_IN.values()}


def test_other_packages_add_types_to_their_entry_point_group():
    assert VISUALIZATIONS.group == "grid_map_visualization_py.visualizations"


def test_visualizations_load_on_first_use():
    code = """
import sys
import grid_map_visualization_py as visualization
assert not [name for name in sys.modules if name.endswith("_msgs")]
assert "surface" in visualization.VISUALIZATIONS.types
assert "visualization_msgs" in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)
    with pytest.raises(AttributeError, match="no attribute 'creat'"):
        _ = grid_map_visualization_py.creat


def test_parameters_are_described():
    found = registry.describe_parameters({"type": "vectors", "params": {}})
    assert found["type"] == "type of the visualization"
    assert found["params.layer_prefix"].startswith("prefix of the ")
    assert registry.describe_parameters({}) == {"type": "type of the visualization"}
