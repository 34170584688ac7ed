# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of single filters, from input map to output map."""

import numpy as np
import pytest
from oracles import PROBES, disc_points, normal_of, window
from terrain import heights, moved_terrain, terrain

from grid_map_core_py import color_value_to_vector
from grid_map_filters_py._builtin import (
    BufferNormalizer,
    Deletion,
    Duplication,
    Inpaint,
    MathExpression,
    MeanInRadius,
    NormalColorMap,
    NormalVectors,
    SlidingWindowMathExpression,
    Threshold,
)

RADII = (0.1, 0.25, 0.5)
STANDARD_DEVIATION = (
    "sqrt(sumOfFinites(square(elevation - meanOfFinites(elevation))) ./ numberOfFinites(elevation))"
)
SHARPEN = np.array([[0, -1, 0], [-1, 5, -1], [0, -1, 0]])


def test_threshold(measure, cells):
    threshold = Threshold(layer="elevation", lower_threshold=0.0, set_to=0.0)
    grid_map = terrain(cells)
    result = measure("Threshold lower=0", cells, lambda: threshold(grid_map))
    np.testing.assert_array_equal(result["elevation"], np.maximum(grid_map["elevation"], 0.0))


def test_duplication(measure, cells):
    duplicate = Duplication(input_layer="elevation", output_layer="copy")
    grid_map = terrain(cells)
    result = measure("Duplication", cells, lambda: duplicate(grid_map))
    np.testing.assert_array_equal(result["copy"], grid_map["elevation"])
    assert not np.shares_memory(result["copy"], grid_map["elevation"])


def test_deletion(measure, cells):
    delete = Deletion(layers=("normal_vectors_x",))
    grid_map = terrain(cells, layers=4)
    result = measure("Deletion (map with 4 layers)", cells, lambda: delete(grid_map))
    assert result.layers == ("elevation", "normal_vectors_y", "normal_vectors_z")


def test_buffer_normalizer(measure, cells):
    normalize = BufferNormalizer()
    grid_map = moved_terrain(cells)
    result = measure("BufferNormalizer (start index != 0)", cells, lambda: normalize(grid_map))
    expected = np.roll(grid_map["elevation"], (-10, -7), axis=(0, 1))
    np.testing.assert_array_equal(result["elevation"], expected)


def test_slope_by_expression(measure, cells):
    slope = MathExpression(expression="acos(normal_vectors_z)", output_layer="slope")
    grid_map = terrain(cells, layers=4)
    result = measure("MathExpression acos(normal_vectors_z)", cells, lambda: slope(grid_map))
    np.testing.assert_allclose(np.cos(result["slope"]), grid_map["normal_vectors_z"], atol=1e-6)


def test_roughness_by_expression(measure, cells):
    text = "abs(elevation - elevation_smooth)"
    roughness = MathExpression(expression=text, output_layer="roughness")
    grid_map = terrain(cells)
    grid_map["elevation_smooth"] = 0.1
    result = measure(f"MathExpression {text}", cells, lambda: roughness(grid_map))
    expected = np.hypot(grid_map["elevation"] - np.float32(0.1), 0)
    np.testing.assert_allclose(result["roughness"], expected, atol=1e-7)


def test_normal_colors(measure, cells):
    color = NormalColorMap(input_layers_prefix="normal_vectors_", output_layer="color")
    grid_map = terrain(cells, layers=4)
    result = measure("NormalColorMap", cells, lambda: color(grid_map))
    normals = np.stack([grid_map[f"normal_vectors_{axis}"] for axis in "xyz"], axis=-1)
    decoded = 2.0 * color_value_to_vector(result["color"]) - 1.0
    np.testing.assert_allclose(decoded, normals, atol=2.1 / 255)


def normals_at(grid_map, cell):
    return np.array([grid_map[f"normal_{axis}"][cell] for axis in "xyz"])


@pytest.mark.parametrize("radius", RADII)
def test_mean_in_radius(measure, cells, radius):
    mean = MeanInRadius(input_layer="elevation", output_layer="mean", radius=radius)
    grid_map = terrain(cells)
    result = measure(f"MeanInRadius r={radius}", cells, lambda: mean(grid_map))
    for cell in PROBES:
        heights_around = disc_points(grid_map, "elevation", cell, radius)[:, 2]
        np.testing.assert_allclose(result["mean"][cell], np.nanmean(heights_around), atol=1e-6)


@pytest.mark.parametrize("radius", RADII)
def test_area_normals(measure, cells, radius):
    normals = NormalVectors(
        input_layer="elevation",
        output_layers_prefix="normal_",
        normal_vector_positive_axis="z",
        radius=radius,
    )
    grid_map = terrain(cells)
    row = f"NormalVectors area serial r={radius}"
    result = measure(row, cells, lambda: normals(grid_map))
    for cell in PROBES:
        points = disc_points(grid_map, "elevation", cell, radius)
        if np.isfinite(grid_map["elevation"][cell]):
            np.testing.assert_allclose(normals_at(result, cell), normal_of(points), atol=1e-5)


def test_raster_normals(measure, cells):
    normals = NormalVectors(
        input_layer="elevation",
        output_layers_prefix="normal_",
        normal_vector_positive_axis="z",
        algorithm="raster",
    )
    grid_map = terrain(cells)
    result = measure("NormalVectors raster serial", cells, lambda: normals(grid_map))
    blocks = np.lib.stride_tricks.sliding_window_view(grid_map["elevation"], (3, 3))
    whole = np.argwhere(np.isfinite(blocks).all(axis=(2, 3)))
    for row, column in whole[[0, len(whole) // 2, -1]] + 1:
        around = blocks[row - 1, column - 1]
        # Row indices increase towards -x, column indices towards -y.
        along_x = (0.1, 0.0, around[0, 1] - around[2, 1])
        along_y = (0.0, 0.1, around[1, 0] - around[1, 2])
        normal = np.cross(along_x, along_y)
        normal /= np.linalg.norm(normal)
        np.testing.assert_allclose(normals_at(result, (row, column)), normal, atol=1e-6)


@pytest.mark.parametrize("radius", [0.05, 0.25])
def test_inpaint(measure, cells, radius):
    inpaint = Inpaint(input_layer="elevation", output_layer="filled", radius=radius)
    grid_map = terrain(cells)
    result = measure(f"Inpaint r={radius}", cells, lambda: inpaint(grid_map))
    known = np.isfinite(grid_map["elevation"])
    np.testing.assert_array_equal(result["filled"][known], grid_map["elevation"][known])
    np.testing.assert_allclose(result["filled"], heights(grid_map), atol=0.15)


def sharpening(size):
    """Return an expression with the kernel as a literal, zero-padded to the window size."""
    kernel = np.pad(SHARPEN, (size - 3) // 2)
    literal = "; ".join(", ".join(map(str, row)) for row in kernel)
    return f"sumOfFinites([{literal}] .* elevation)"


def measure_windows(measure, row, cells, expression, edge_handling, size):
    slide = SlidingWindowMathExpression(
        input_layer="elevation",
        output_layer="out",
        expression=expression,
        edge_handling=edge_handling,
        window_size=size,
    )
    grid_map = terrain(cells)
    result = measure(f"SlidingWindow {row} w={size}", cells, lambda: slide(grid_map))
    return grid_map["elevation"], result["out"]


@pytest.mark.parametrize("size", [3, 5, 9])
def test_mean_of_windows(measure, cells, size):
    layer, mean = measure_windows(
        measure, "meanOfFinites crop", cells, "meanOfFinites(elevation)", "crop", size
    )
    for cell in PROBES:
        np.testing.assert_allclose(mean[cell], np.nanmean(window(layer, cell, size)), atol=1e-6)


@pytest.mark.parametrize("size", [3, 5, 9])
def test_standard_deviation_of_windows(measure, cells, size):
    layer, deviation = measure_windows(
        measure, "stddev crop", cells, STANDARD_DEVIATION, "crop", size
    )
    for cell in PROBES:
        np.testing.assert_allclose(deviation[cell], np.nanstd(window(layer, cell, size)), atol=1e-6)


@pytest.mark.parametrize("size", [3, 5, 9])
def test_sharpening_of_windows(measure, cells, size):
    layer, sharp = measure_windows(
        measure, "sharpen mean-edge", cells, sharpening(size), "mean", size
    )
    for row, column in PROBES[1:-1]:
        around = window(layer, (row, column), 3)
        np.testing.assert_allclose(sharp[row, column], np.nansum(SHARPEN * around), atol=1e-5)
