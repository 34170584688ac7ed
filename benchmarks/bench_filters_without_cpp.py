# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of filters that do not exist in C++."""

import numpy as np
import pytest
from oracles import PROBES, disc_points, normal_of
from terrain import terrain

from grid_map_filters_py._builtin import (
    Bilateral,
    Cost,
    Dilation,
    GaussianBlur,
    Inflation,
    Inpaint,
    Roughness,
    Slope,
    StepHeight,
    Traversability,
)

IN_OUT = {"input_layer": "elevation", "output_layer": "out"}


def finite_probes(grid_map):
    cells = [cell for cell in PROBES if np.isfinite(grid_map["elevation"][cell])]
    assert cells
    return cells


@pytest.mark.parametrize("radius", [0.1, 0.5])
def test_dilation(measure, cells, radius):
    dilate, grid_map = Dilation(**IN_OUT, radius=radius), terrain(cells)
    result = measure(f"Dilation r={radius}", cells, lambda: dilate(grid_map))["out"]
    for cell in finite_probes(grid_map):
        assert result[cell] == np.nanmax(disc_points(grid_map, "elevation", cell, radius)[:, 2])


def test_step_height(measure, cells):
    climb = StepHeight(**IN_OUT, radius=0.1, second_window_radius=0.1, critical_value=0.0)
    grid_map = terrain(cells)
    result = measure("StepHeight r=0.1, twice", cells, lambda: climb(grid_map))["out"]
    single = StepHeight(**IN_OUT, radius=0.1)(grid_map)
    for cell in finite_probes(grid_map):
        highest = np.nanmax(disc_points(single, "out", cell, 0.1)[:, 2])
        np.testing.assert_allclose(result[cell], highest, rtol=1e-6)


def test_slope(measure, cells):
    tilt, grid_map = Slope(**IN_OUT, radius=0.1), terrain(cells)
    result = measure("Slope r=0.1", cells, lambda: tilt(grid_map))["out"]
    for cell in finite_probes(grid_map):
        z = normal_of(disc_points(grid_map, "elevation", cell, 0.1))[2]
        np.testing.assert_allclose(np.cos(result[cell]), abs(z), atol=1e-5)


def test_roughness(measure, cells):
    roughen, grid_map = Roughness(**IN_OUT, radius=0.15), terrain(cells)
    result = measure("Roughness r=0.15", cells, lambda: roughen(grid_map))["out"]
    for cell in finite_probes(grid_map):
        points = disc_points(grid_map, "elevation", cell, 0.15)
        points = points[np.isfinite(points[:, 2])]
        deviation = np.sqrt(np.linalg.eigvalsh(np.cov(points.T))[0])
        np.testing.assert_allclose(result[cell], deviation, rtol=1e-3, atol=1e-7)


def test_traversability(measure, cells):
    assess = Traversability(
        input_layers=("elevation", "other"), output_layer="out", critical_values=(1.0, 2.0)
    )
    grid_map = terrain(cells)
    grid_map["other"] = 0.5
    result = measure("Traversability of 2 layers", cells, lambda: assess(grid_map))["out"]
    expected = 0.5 * (1 - np.maximum(grid_map["elevation"], 0)) + 0.5 * 0.75
    np.testing.assert_allclose(result, expected, atol=1e-6)


def test_costs_and_inflation(measure, cells):
    grid_map = terrain(cells)
    high = float(np.nanquantile(grid_map["elevation"], 0.95))
    judge = Cost(**IN_OUT, free_value=0.0, lethal_value=high)
    inflate = Inflation(
        input_layer="out",
        output_layer="inflated",
        inscribed_radius=0.3,
        inflation_radius=1.0,
        cost_scaling_factor=3.0,
    )
    result = measure("Cost, Inflation r=1.0", cells, lambda: inflate(judge(grid_map)))
    costs, lethal = result["out"], np.argwhere(result["out"] == 254)
    assert 0 < len(lethal) < costs.size / 2
    for cell in finite_probes(grid_map):
        distance = np.hypot(*(lethal - cell).T).min() * grid_map.resolution
        within = [(0.0, 254), (0.3, 253), (1.0, np.floor(252 * np.exp(-3 * (distance - 0.3))))]
        cost = next((cost for limit, cost in within if distance <= limit), 0)
        assert result["inflated"][cell] == max(cost, costs[cell])


def test_gaussian_blur(measure, cells):
    blur, grid_map = GaussianBlur(**IN_OUT, sigma=0.1), terrain(cells)
    result = measure("GaussianBlur sigma=0.1", cells, lambda: blur(grid_map))["out"]
    assert_near_the_terrain(result, grid_map)


def test_bilateral(measure, cells):
    smooth = Bilateral(**IN_OUT, sigma_space=0.1, sigma_range=0.1)
    grid_map = terrain(cells)
    result = measure("Bilateral sigma=0.1", cells, lambda: smooth(grid_map))["out"]
    assert_near_the_terrain(result, grid_map)


def assert_near_the_terrain(result, grid_map):
    difference = np.abs(result - grid_map["elevation"])
    np.testing.assert_array_equal(np.isnan(difference), np.isnan(grid_map["elevation"]))
    assert 1e-3 < np.nanmax(difference) < 0.1


def test_inpaint_within_limits(measure, cells):
    fill = Inpaint(**IN_OUT, radius=0.1, enclosed_holes_only=True, max_hole_area=0.02)
    grid_map = terrain(cells)
    result = measure("Inpaint r=0.1 with limits", cells, lambda: fill(grid_map))["out"]
    filled = np.isfinite(result) & ~np.isfinite(grid_map["elevation"])
    assert filled.any()
    assert not filled[[0, -1]].any()
    assert not filled[:, [0, -1]].any()
