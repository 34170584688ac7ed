# SPDX-License-Identifier: BSD-3-Clause
"""The layers of the tutorial demo equal the C++ recording, except for noise."""

from pathlib import Path

import numpy as np
import pytest
from demos import published

from grid_map_core_py import GridMap
from grid_map_demos_py.tutorial_demo_node import (
    add_filtered,
    add_noise,
    add_outliers,
    add_wave,
    cells_to_filter,
    make_map,
    root_mean_square,
)
from grid_map_ros_py import load_from_bag

DATA = Path(__file__).parents[2] / "grid_map_ros_py" / "test" / "data"


@pytest.fixture(scope="module")
def recorded() -> GridMap:
    """Return a map that the C++ tutorial demo has published."""
    return load_from_bag(DATA / "cpp_tutorial_outputs.mcap", "/grid_map")


def test_wave_equals_cpp(recorded):
    grid_map = make_map()
    assert grid_map.geometry == recorded.geometry
    add_wave(grid_map, 1e-9 * recorded.timestamp)
    for layer in grid_map:
        np.testing.assert_allclose(grid_map[layer], recorded[layer], atol=1e-6, err_msg=layer)


def test_filter_of_recorded_noise_equals_cpp(recorded):
    cells = cells_to_filter(recorded)
    assert np.isinf(recorded["elevation_noisy"][cells]).sum() > 50
    filtered = recorded.copy()
    add_filtered(filtered, cells, 0.1)
    for layer in ("elevation_filtered", "error"):
        np.testing.assert_allclose(filtered[layer], recorded[layer], rtol=1e-6, atol=1e-7)


def test_noise_is_even_and_outliers_are_infinite():
    random = np.random.default_rng(0)
    grid_map = make_map()
    grid_map["elevation"] = 1.0
    add_noise(grid_map, 0.5, random)
    noise = grid_map["elevation_noisy"] - 1.0
    np.testing.assert_allclose(noise, grid_map["noise"], atol=1e-6)
    assert np.percentile(noise, [0, 25, 75, 100]) == pytest.approx(
        [-0.5, -0.25, 0.25, 0.5], abs=0.03
    )
    add_outliers(grid_map, 500, random)
    outliers = np.argwhere(~np.isfinite(grid_map["elevation_noisy"]))
    # Points on 2 x 2 m that hit the map of 1.2 x 1.905 m, less those that hit a cell twice.
    assert 220 < len(outliers) < 310
    assert np.ptp(outliers, axis=0).min() > 30
    assert np.isfinite(grid_map["elevation"]).all()


def test_the_tutorial_demo_publishes_all_layers_and_reports_the_error(recorded):
    (first, *_, last), _ = published(
        "tutorial_demo",
        count=10,
        until=lambda process: process.text.count("root mean square error") >= 2,
    )
    assert last.layers == recorded.layers
    assert (last.frame_id, last.geometry) == ("map", recorded.geometry)
    assert last.timestamp > first.timestamp
    add_wave(first, 1e-9 * last.timestamp)
    np.testing.assert_allclose(last["elevation"], first["elevation"], atol=1e-5)
    assert 0.0149 < np.abs(last["noise"]).max() <= 0.015
    assert not np.array_equal(last["noise"], first["noise"])
    cells = cells_to_filter(last)
    assert np.isfinite(last["elevation_filtered"][cells]).all()
    assert root_mean_square(last["error"][cells]) < 0.5 * root_mean_square(last["noise"])
    assert np.isinf(last["elevation_filtered"]).sum() > 50
    difference = np.abs(last["elevation_filtered"] - last["elevation"])
    np.testing.assert_array_equal(last["error"], difference)


def test_the_parameters_of_the_tutorial_demo_take_effect():
    given = ("noise:=0", "outliers:=0", "radius:=0.02", "publish_rate:=4.0")
    maps, _ = published("tutorial_demo", *given, count=4)
    for grid_map in maps:
        assert not grid_map["noise"].any()
        # Discs with a radius of one cell.
        np.testing.assert_allclose(grid_map["error"], 0.0, atol=1e-8)
