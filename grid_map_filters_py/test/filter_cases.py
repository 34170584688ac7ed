# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps for tests of filters, functions that run filters, and valid parameters of all filters."""

import filter_oracles as oracles
import numpy as np
from hypothesis import strategies as st

from grid_map_core_py import GridMap, circle_cells
from grid_map_filters_py import FilterChain, Step

CELLS = st.sampled_from([0.0, 0.9, 1.0, 1.5, 2.0, 2.3, 5.0, 8.0])
"""Radii in cells: below one, on the rim of a disc, beyond the map."""

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

OF_ANY_MAP = [
    ("gridMapFilters/BufferNormalizerFilter", {}),
    ("gridMapFilters/DeletionFilter", {"layers": ["other"]}),
    ("gridMapFilters/SetBasicLayersFilter", {"layers": ["other"]}),
    (
        "gridMapFilters/ColorFillFilter",
        {"red": 0.1, "green": 0.5, "blue": 0.9, "output_layer": "color"},
    ),
]
"""Filters that work on maps without layers."""

OF_THEIR_LAYERS = [
    (
        "gridMapFilters/ColorFillFilter",
        {"red": 0.1, "green": 0.5, "blue": 0.9, "mask_layer": "other", "output_layer": "color"},
    ),
    *(
        (
            "gridMapFilters/ColorBlendingFilter",
            {
                "background_layer": "elevation",
                "foreground_layer": "other",
                "blend_mode": mode,
                "opacity": 0.4,
                "output_layer": "color",
            },
        )
        for mode in ("normal", "hard_light", "soft_light")
    ),
    (
        "gridMapFilters/ColorMapFilter",
        {
            "input_layer": "elevation",
            "output_layer": "color",
            "min": {"value": -1.0, "color": [0, 0, 1]},
            "max": {"value": 1.0, "color": [1, 0, 0]},
        },
    ),
    ("gridMapFilters/CurvatureFilter", {"input_layer": "elevation", "output_layer": "elevation"}),
    (
        "gridMapFilters/LightIntensityFilter",
        {"input_layers_prefix": "n_", "output_layer": "color", "light_direction": [0.3, 0.1, -1]},
    ),
    (
        "gridMapFilters/MedianFillFilter",
        {
            "input_layer": "elevation",
            "output_layer": "elevation",
            "fill_hole_radius": 0.2,
            "filter_existing_values": True,
            "existing_value_radius": 0.1,
            "fill_mask_layer": "mask",
            "debug": True,
            "debug_infill_mask_layer": "opened",
        },
    ),
    (
        "gridMapFilters/MedianFillFilter",
        {
            "input_layer": "elevation",
            "output_layer": "filled",
            "fill_hole_radius": 0.3,
            "fill_mask_layer": "other",
        },
    ),
    (
        "gridMapFilters/MinInRadiusFilter",
        {"input_layer": "elevation", "output_layer": "elevation", "radius": 0.3},
    ),
    (
        "gridMapFilters/TraversabilityFilter",
        {
            "input_layers": ["elevation", "other"],
            "critical_values": [1.0, 2.0],
            "output_layer": "out",
        },
    ),
    ("gridMapFilters/DuplicationFilter", {"input_layer": "elevation", "output_layer": "out"}),
    (
        "gridMapFilters/MathExpressionFilter",
        {"expression": "elevation + other", "output_layer": "out"},
    ),
    (
        "gridMapFilters/MeanInRadiusFilter",
        {"input_layer": "elevation", "output_layer": "elevation", "radius": 0.3},
    ),
    ("gridMapFilters/NormalColorMapFilter", {"input_layers_prefix": "n_", "output_layer": "color"}),
    (
        "gridMapFilters/NormalVectorsFilter",
        {
            "input_layer": "elevation",
            "output_layers_prefix": "n_",
            "normal_vector_positive_axis": "z",
            "radius": 0.3,
        },
    ),
    (
        "gridMapFilters/NormalVectorsFilter",
        {
            "input_layer": "elevation",
            "output_layers_prefix": "n_",
            "normal_vector_positive_axis": "x",
            "algorithm": "raster",
        },
    ),
    (
        "gridMapFilters/SlidingWindowMathExpressionFilter",
        {
            "input_layer": "elevation",
            "output_layer": "elevation",
            "expression": "meanOfFinites(elevation)",
            "edge_handling": "crop",
        },
    ),
    (
        "gridMapFilters/ThresholdFilter",
        {"layer": "elevation", "upper_threshold": 1.0, "set_to": 1.0},
    ),
    (
        "gridMapCv/InpaintFilter",
        {"input_layer": "elevation", "output_layer": "elevation", "radius": 0.3},
    ),
]
"""Filters that fail without their input layers."""

HEIGHTS_TO_HEIGHTS = [
    ("gridMapFilters/BilateralFilter", {"sigma_space": 0.1, "sigma_range": 0.5}),
    ("gridMapFilters/GaussianBlurFilter", {"sigma": 0.1}),
    ("gridMapFilters/GaussianBlurFilter", {"sigma": 0.1, "compute_empty_cells": True}),
    ("gridMapFilters/DilationFilter", {"radius": 0.3}),
    ("gridMapFilters/ErosionFilter", {"radius": 0.3, "compute_empty_cells": True}),
    ("gridMapCv/InpaintFilter", {"radius": 0.3, "enclosed_holes_only": True, "max_hole_area": 0.3}),
]
"""Filters from `input_layer` to `output_layer`, with their other parameters."""

HEIGHTS_TO_MEASURES = [
    ("gridMapFilters/RoughnessFilter", {"radius": 0.3}),
    ("gridMapFilters/SlopeFilter", {}),
    ("gridMapFilters/SlopeFilter", {"radius": 0.3}),
    ("gridMapFilters/StepHeightFilter", {"radius": 0.3}),
    (
        "gridMapFilters/StepHeightFilter",
        {"radius": 0.3, "second_window_radius": 0.3, "critical_value": 0.2},
    ),
]
"""Filters from `input_layer` to `output_layer` whose results do not depend on a height offset."""

HEIGHTS_TO_LAYER = HEIGHTS_TO_HEIGHTS + HEIGHTS_TO_MEASURES

EVERY_FILTER = [
    *OF_ANY_MAP,
    *OF_THEIR_LAYERS,
    *((type_name, TO_OUT | params) for type_name, params in HEIGHTS_TO_LAYER),
]
