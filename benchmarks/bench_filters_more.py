# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of the minimum, median, curvature and color filters."""

import numpy as np
import pytest
from oracles import PROBES, disc_points, window
from terrain import RESOLUTION, terrain

from grid_map_core_py import color_value_to_vector
from grid_map_filters_py._builtin import (
    ColorBlending,
    ColorFill,
    ColorMap,
    Curvature,
    LightIntensity,
    MedianFill,
    MinInRadius,
    SetBasicLayers,
)

RADII = (0.1, 0.25, 0.5)
STEP = 1 / 255


@pytest.mark.parametrize("radius", RADII)
def test_min_in_radius(measure, cells, radius):
    lowest = MinInRadius(input_layer="elevation", output_layer="lowest", radius=radius)
    grid_map = terrain(cells)
    result = measure(f"MinInRadius r={radius}", cells, lambda: lowest(grid_map))
    for cell in PROBES:
        if np.isfinite(grid_map["elevation"][cell]):
            heights = disc_points(grid_map, "elevation", cell, radius)[:, 2]
            assert result["lowest"][cell] == np.nanmin(heights)


def upper_median(layer, cell, radius):
    values = window(layer, cell, 2 * int(radius / RESOLUTION + 1e-9) + 1)
    values = np.sort(values[np.isfinite(values)])
    return values[values.size // 2]


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("existing", [False, True], ids=["holes", "existing"])
def test_median_fill(measure, cells, radius, existing):
    fill = MedianFill(
        input_layer="elevation",
        output_layer="filled",
        fill_hole_radius=radius,
        filter_existing_values=existing,
        existing_value_radius=radius,
        fill_mask_layer="mask",
    )
    grid_map = terrain(cells)
    row = f"MedianFill {'fill+existing' if existing else 'fill_hole'} r={radius}"
    result = measure(row, cells, lambda: fill(grid_map))
    elevation = grid_map["elevation"]
    holes = [tuple(cell) for cell in np.argwhere(np.isnan(elevation))[:: cells * 5]]
    assert len(holes) >= 2
    for cell in (*PROBES, *holes):
        changes = result["mask"][cell] and (existing or np.isnan(elevation[cell]))
        expected = upper_median(elevation, cell, radius) if changes else elevation[cell]
        np.testing.assert_array_equal(result["filled"][cell], np.float32(expected))


def test_curvature(measure, cells):
    curve = Curvature(input_layer="elevation", output_layer="curvature")
    grid_map = terrain(cells)
    result = measure("Curvature", cells, lambda: curve(grid_map))
    z = grid_map["elevation"].astype(np.float64)
    expected = 4 * z[1:-1, 1:-1] - z[2:, 1:-1] - z[:-2, 1:-1] - z[1:-1, 2:] - z[1:-1, :-2]
    expected /= RESOLUTION**2
    whole = np.isfinite(expected)
    inner = result["curvature"][1:-1, 1:-1]
    np.testing.assert_allclose(inner[whole], expected[whole], atol=1e-3)
    np.testing.assert_array_equal(np.isnan(result["curvature"]), np.isnan(z))


def test_light_intensity(measure, cells):
    direction = np.array([-0.2, -0.3, -1.0])
    shade = LightIntensity(
        input_layers_prefix="normal_vectors_",
        output_layer="color",
        light_direction=tuple(direction),
    )
    grid_map = terrain(cells, layers=4)
    result = measure("LightIntensity", cells, lambda: shade(grid_map))
    normals = np.stack([grid_map[f"normal_vectors_{axis}"] for axis in "xyz"], axis=-1)
    expected = np.maximum(normals @ -direction / np.linalg.norm(direction), 0)
    for channel in np.moveaxis(color_value_to_vector(result["color"]), -1, 0):
        np.testing.assert_allclose(channel, expected, atol=1.01 * STEP)


def ramp(layer, output_layer, **colors):
    values = {"min_value": -0.3, "max_value": 0.3}
    return ColorMap(input_layer=layer, output_layer=output_layer, **values, **colors)


RED_TO_BLUE = {"min_color": (1.0, 0.2, 0.0), "max_color": (0.0, 0.2, 1.0)}
GREEN_TO_WHITE = {"min_color": (0.0, 1.0, 0.0), "max_color": (1.0, 1.0, 1.0)}


def test_color_map(measure, cells):
    color = ramp("elevation", "color", **RED_TO_BLUE)
    grid_map = terrain(cells)
    result = measure("ColorMap", cells, lambda: color(grid_map))
    share = np.clip((grid_map["elevation"] + 0.3) / 0.6, 0, 1)
    red, green, blue = np.moveaxis(color_value_to_vector(result["color"]), -1, 0)
    np.testing.assert_allclose(red, 1 - share, atol=1.01 * STEP)
    np.testing.assert_allclose(green, 0.2 + 0 * share, atol=1.01 * STEP)
    np.testing.assert_allclose(blue, share, atol=1.01 * STEP)


@pytest.mark.parametrize("mask", ["", "elevation"], ids=["no mask", "mask"])
def test_color_fill(measure, cells, mask):
    fill = ColorFill(red=0.2, green=0.4, blue=0.6, mask_layer=mask, output_layer="color")
    grid_map = terrain(cells)
    row = f"ColorFill ({f'mask {mask}' if mask else 'no mask'})"
    result = measure(row, cells, lambda: fill(grid_map))
    empty = np.isnan(grid_map["elevation"]) & bool(mask)
    np.testing.assert_array_equal(np.isnan(result["color"]), empty)
    colors = color_value_to_vector(result["color"])[~empty]
    np.testing.assert_allclose(colors, np.broadcast_to([0.2, 0.4, 0.6], colors.shape), atol=STEP)


@pytest.mark.parametrize("mode", ["normal", "hard_light", "soft_light"])
def test_color_blending(measure, cells, mode):
    blend = ColorBlending(
        background_layer="back",
        foreground_layer="fore",
        blend_mode=mode,
        opacity=0.5,
        output_layer="blend",
    )
    colored = ramp("elevation", "back", **RED_TO_BLUE)(terrain(cells, layers=4))
    grid_map = ramp("normal_vectors_x", "fore", **GREEN_TO_WHITE)(colored)
    result = measure(f"ColorBlending {mode}", cells, lambda: blend(grid_map))
    b, f = (color_value_to_vector(grid_map[layer]) for layer in ("back", "fore"))
    dark = f.mean(axis=-1, keepdims=True) < 0.5
    over = {
        "normal": f,
        "hard_light": np.where(dark, 2 * b * f, 1 - 2 * (1 - b) * (1 - f)),
        "soft_light": (1 - 2 * f) * b**2 + 2 * b * f,
    }[mode]
    both = np.isfinite(b + f)
    expected = np.clip(0.5 * b + 0.5 * over, 0, 1)[both]
    np.testing.assert_allclose(
        color_value_to_vector(result["blend"])[both], expected, atol=1.01 * STEP
    )


def test_set_basic_layers(measure, cells):
    set_layers = SetBasicLayers(layers=("elevation",))
    grid_map = terrain(cells)
    result = measure("SetBasicLayers", cells, lambda: set_layers(grid_map))
    assert result.basic_layers == ("elevation",)
