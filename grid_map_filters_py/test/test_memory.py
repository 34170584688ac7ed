# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Peak memory of filters beside their input and output."""

import gc
import tracemalloc

import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_filters_py import FilterChain
from grid_map_filters_py.expression import Expression

SIDE = 500
DEVIATION = "sqrt(sumOfFinites(square(slope - meanOfFinites(slope))) ./ numberOfFinites(slope))"


def step(name, **params):
    namespace = "gridMapCv" if name == "Inpaint" else "gridMapFilters"
    layers = str(params.get("output_layer", ""))
    return {"name": name + layers, "type": f"{namespace}/{name}Filter", "params": params}


TRAVERSABILITY = [
    step("Inpaint", input_layer="elevation", output_layer="filled", radius=0.05),
    step("MeanInRadius", input_layer="filled", output_layer="smooth", radius=0.06),
    step(
        "NormalVectors",
        input_layer="filled",
        output_layers_prefix="normal_",
        normal_vector_positive_axis="z",
        radius=0.1,
    ),
    step("NormalColorMap", input_layers_prefix="normal_", output_layer="normal_color"),
    step("MathExpression", expression="acos(normal_z)", output_layer="slope"),
    step("MathExpression", expression="abs(filled - smooth)", output_layer="roughness"),
    step(
        "SlidingWindowMathExpression",
        input_layer="slope",
        output_layer="edges",
        expression=DEVIATION,
        edge_handling="crop",
    ),
    step(
        "MathExpression",
        expression="0.5 * (1.0 - slope / 0.6) + 0.5 * (1.0 - roughness / 0.1)",
        output_layer="traversability",
    ),
    step("Threshold", layer="traversability", lower_threshold=0.0, set_to=0.0),
    step("Duplication", input_layer="traversability", output_layer="copy"),
]

OTHERS = [
    step("Bilateral", input_layer="elevation", output_layer="o", sigma_space=0.1, sigma_range=0.1),
    step("Curvature", input_layer="elevation", output_layer="o"),
    step("Dilation", input_layer="elevation", output_layer="o", radius=0.5),
    step("GaussianBlur", input_layer="elevation", output_layer="o", sigma=0.2),
    step(
        "MedianFill",
        input_layer="elevation",
        output_layer="o",
        fill_hole_radius=0.2,
        fill_mask_layer="m",
    ),
    step("MinInRadius", input_layer="elevation", output_layer="o", radius=0.5),
    step("Roughness", input_layer="elevation", output_layer="o", radius=0.5),
    step("Slope", input_layer="elevation", output_layer="o", radius=0.25),
    step("StepHeight", input_layer="elevation", output_layer="o", radius=0.1),
]


@pytest.fixture(scope="module")
def grid_map() -> GridMap:
    random = np.random.default_rng(5)
    heights = np.cumsum(random.normal(size=(SIDE, SIDE)) * 0.01, axis=0)
    heights[random.random(heights.shape) < 0.05] = np.nan
    return GridMap((SIDE * 0.05, SIDE * 0.05), 0.05, layers={"elevation": heights})


def peak_above_result(operation, layer_bytes):
    """Return the peak memory besides the result, and the size of the result [layers]."""
    operation()  # memory that is allocated once is not counted
    gc.collect()
    gc.disable()  # memory must be freed by reference counts, not by garbage collection
    tracemalloc.start()
    try:
        result = operation()
        current, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        gc.enable()
    assert result is not None
    return (peak - current) / layer_bytes, current / layer_bytes


def test_chain_needs_memory_for_less_than_six_layers(grid_map):
    chain = FilterChain.from_config(TRAVERSABILITY)
    above, result = peak_above_result(lambda: chain(grid_map), grid_map["elevation"].nbytes)
    assert above < 6
    # The result holds a copy of its input and the layers that the steps have added.
    assert result == pytest.approx(len(chain(grid_map).layers), abs=0.2)


@pytest.mark.parametrize("config", TRAVERSABILITY + OTHERS, ids=lambda config: config["name"])
def test_a_filter_needs_memory_for_less_than_six_layers(grid_map, config):
    names = [s["name"] for s in TRAVERSABILITY]
    before = TRAVERSABILITY[: names.index(config["name"])] if config in TRAVERSABILITY else []
    given = FilterChain.from_config(before)(grid_map) if before else grid_map
    (filter_step,) = FilterChain.from_config([config]).steps
    above, _ = peak_above_result(lambda: filter_step.filter(given), given["elevation"].nbytes)
    assert above < 6


@pytest.mark.parametrize("edge_handling", ["inside", "crop", "empty", "mean"])
@pytest.mark.parametrize("expression", [DEVIATION, "max(slope) - min(slope)"])
def test_windows_free_all_memory(grid_map, edge_handling, expression):
    layer = grid_map["elevation"]
    over_windows = Expression(expression).over_windows
    _, result = peak_above_result(
        lambda: over_windows("slope", layer, 3, edge_handling), layer.nbytes
    )
    assert result == pytest.approx(1.0, abs=0.1)
