# SPDX-License-Identifier: BSD-3-Clause
"""Maps for tests of filters, functions that run filters, and valid parameters of all filters."""

import filter_oracles as oracles
import numpy as np
from hypothesis import strategies as st

from grid_map_core_py import GridMap, circle_cells
from grid_map_filters_py import FilterChain, Step

CELLS = st.sampled_from([0.0, 0.9, 1.0, 1.5, 2.0, 2.3, 5.0, 8.0])
"""Radii in cells: below one, on the edge of a disc, beyond the map."""

CELLS_OF_PLANES = st.sampled_from([0.9, 1.0, 1.5, 2.0, 3.0])
"""Radii in cells: of discs with one point, and with enough points for a plane."""

STEPS = np.arange(70.0).reshape(10, 7)
"""Different heights from 0 to 69, with mean 34.5."""

TO_OUT = {"input_layer": "elevation", "output_layer": "out"}


def terrain(size=(9, 7), resolution=0.1, **layers) -> GridMap:
    return GridMap(np.multiply(size, resolution), resolution, layers=layers)


def ground(heights, resolution=0.1) -> GridMap:
    return terrain(np.shape(heights), resolution, elevation=heights)


def step_of(type_name, **params) -> Step:
    config = [{"name": "under_test", "type": type_name, "params": params}]
    (step,) = FilterChain.from_config(config).steps
    return step


def run(type_name, grid_map, **params) -> GridMap:
    return FilterChain([step_of(type_name, **params)])(grid_map)


def filtered(type_name, grid_map, **params) -> np.ndarray:
    """Return the output layer of a filter with the input layer `elevation`."""
    return run(type_name, grid_map, **TO_OUT | params)["out"]


def points_in_disc(grid_map, index, radius) -> np.ndarray:
    """Return the finite points (N, 3) of a disc, by a loop over its cells."""
    cells = circle_cells(grid_map, grid_map.get_position(index), radius)
    points = [grid_map.get_position3("elevation", cell) for cell in zip(*cells, strict=True)]
    return np.array([point for point in points if np.isfinite(point).all()]).reshape(-1, 3)


def assert_cells_are(result, expected, **tolerances):
    """Compare a layer with the values of a function of the index."""
    wanted = [expected(index) for index in np.ndindex(result.shape)]
    np.testing.assert_allclose(result, np.reshape(wanted, result.shape), **tolerances)


def assert_bytes_near(color, expected):
    """Compare a color with channels from 0 to 255.

    Fractions are cut off, and rounding may decide which.
    """
    cut_off = np.clip(expected, 0, 255) - oracles.to_bytes(color)
    assert cut_off.min() > -1e-3
    assert cut_off.max() < 1 + 1e-3


# --- every filter ---------------------------------------------------------------------------------

LAYERS = ("elevation", "other", "n_x", "n_y", "n_z")
"""The layers that the filters below read."""

ONTO_ITSELF = {"input_layer": "elevation", "output_layer": "elevation"}
COLOR = {"red": 0.1, "green": 0.5, "blue": 0.9, "output_layer": "color"}

OF_ANY_MAP = [
    ("BufferNormalizer", {}),
    ("Deletion", {"layers": ["other"]}),
    ("SetBasicLayers", {"layers": ["other"]}),
    ("ColorFill", COLOR),
]
"""Filters that work on maps without layers."""

BLENDING = {"background_layer": "elevation", "foreground_layer": "other", "opacity": 0.4}
RAMP = {"min": {"value": -1.0, "color": [0, 0, 1]}, "max": {"value": 1.0, "color": [1, 0, 0]}}
NORMALS = {"input_layer": "elevation", "output_layers_prefix": "n_"}
FILLING = {
    "fill_hole_radius": 0.2,
    "filter_existing_values": True,
    "existing_value_radius": 0.1,
    "fill_mask_layer": "mask",
    "debug": True,
    "debug_infill_mask_layer": "opened",
}
MEAN = {"expression": "meanOfFinites(elevation)", "edge_handling": "crop"}
COSTS = {"free_value": 0.0, "lethal_value": 1.0, "lethal_layer": "other", "lethal_above": 0.5}
SCORES = {"input_layers": ["elevation", "other"], "critical_values": [1.0, 2.0]}

OF_THEIR_LAYERS = [
    ("ColorFill", COLOR | {"mask_layer": "other"}),
    *(
        ("ColorBlending", BLENDING | {"blend_mode": mode, "output_layer": "color"})
        for mode in ("normal", "hard_light", "soft_light")
    ),
    ("ColorMap", TO_OUT | RAMP),
    ("Cost", TO_OUT | COSTS),
    ("Curvature", ONTO_ITSELF),
    ("Footprint", TO_OUT | {"radius": 0.1}),
    (
        "LightIntensity",
        {"input_layers_prefix": "n_", "output_layer": "color", "light_direction": [0.3, 0.1, -1]},
    ),
    ("MedianFill", ONTO_ITSELF | FILLING),
    ("MedianFill", TO_OUT | {"fill_hole_radius": 0.3, "fill_mask_layer": "other"}),
    ("Inflation", ONTO_ITSELF | {"inscribed_radius": 0.1, "inflation_radius": 0.3}),
    ("MinInRadius", ONTO_ITSELF | {"radius": 0.3}),
    ("Traversability", SCORES | {"output_layer": "out"}),
    ("Duplication", TO_OUT),
    ("MathExpression", {"expression": "elevation + other", "output_layer": "out"}),
    ("MeanInRadius", ONTO_ITSELF | {"radius": 0.3}),
    ("NormalColorMap", {"input_layers_prefix": "n_", "output_layer": "color"}),
    ("NormalVectors", NORMALS | {"normal_vector_positive_axis": "z", "radius": 0.3}),
    ("NormalVectors", NORMALS | {"normal_vector_positive_axis": "x", "algorithm": "raster"}),
    ("SlidingWindowMathExpression", ONTO_ITSELF | MEAN),
    ("PlanarRegions", TO_OUT),
    ("Threshold", {"layer": "elevation", "upper_threshold": 1.0, "set_to": 1.0}),
    ("Inpaint", ONTO_ITSELF | {"radius": 0.3}),
]
"""Filters that fail without their input layers."""

HEIGHTS_TO_HEIGHTS = [
    ("Bilateral", {"sigma_space": 0.1, "sigma_range": 0.5}),
    ("GaussianBlur", {"sigma": 0.1}),
    ("GaussianBlur", {"sigma": 0.1, "compute_empty_cells": True}),
    ("Dilation", {"radius": 0.3}),
    ("Erosion", {"radius": 0.3, "compute_empty_cells": True}),
    ("Inpaint", {"radius": 0.3, "enclosed_holes_only": True, "max_hole_area": 0.3}),
]
"""Filters from `input_layer` to `output_layer`, with their other parameters."""

HEIGHTS_TO_MEASURES = [
    ("Roughness", {"radius": 0.3}),
    ("Slope", {}),
    ("Slope", {"radius": 0.3}),
    ("StepHeight", {"radius": 0.3}),
    ("StepHeight", {"radius": 0.3, "second_window_radius": 0.3, "critical_value": 0.2}),
]
"""Filters from `input_layer` to `output_layer` whose results do not depend on a height offset."""

HEIGHTS_TO_LAYER = HEIGHTS_TO_HEIGHTS + HEIGHTS_TO_MEASURES

EVERY_FILTER = [
    *OF_ANY_MAP,
    *OF_THEIR_LAYERS,
    *((type_name, TO_OUT | params) for type_name, params in HEIGHTS_TO_LAYER),
]
