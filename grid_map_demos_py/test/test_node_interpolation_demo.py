# SPDX-License-Identifier: BSD-3-Clause
"""Errors of interpolation methods between the samples of a surface."""

import math

import numpy as np
import pytest
from demos import parameters

from grid_map_core_py import GridMap, Interpolation
from grid_map_core_py.map import GridGeometry
from grid_map_demos_py.interpolation_demo_node import METHODS, WORLDS, measure, sampled, table
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message
from grid_map_ros_py.testing import peer, running_node

TOPICS = ("/ground_truth", "/data_sparse", "/interpolated")

# --- worlds and methods ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("world", "position", "height"),
    [
        # Positions next to each hill, computed by hand.
        ("Gauss", (1.5, -0.7), -1.519150),
        ("Gauss", (1.3, 1.3), -0.606814),
        ("Gauss", (-0.8, 1.5), 3.122311),
        ("Gauss", (-1.6, -2.0), 0.657459),
        ("Gauss", (-1.3, 1.9), 2.632708),
        ("Gauss", (0.2, 0.1), 2.768313),
        ("Gauss", (-1.1, 0.2), 0.592961),
        ("Tanh", (0.1, 0.0), math.tanh(0.5)),
        ("Tanh", (9.0, -9.0), 0.0),
    ],
)
def test_height_of_world_equals_computation_by_hand(world, position, height):
    x, y = np.transpose([position])
    assert WORLDS[world](x, y) == pytest.approx(height, abs=1e-5)


def test_nearest_errs_on_a_slope_and_linear_does_not():
    def slope(x, y):
        return x + 0.0 * y

    fine = GridGeometry(np.array([2.0, 1.0]), 0.02)
    data = sampled(slope, GridGeometry(fine.length, 0.1))
    mean, largest, microseconds = measure(slope, data, fine, Interpolation.NEAREST)
    # Five cells per sample, 0, 0.02 or 0.04 m from it; two fewer at each border.
    assert largest == pytest.approx(0.04, rel=1e-5)
    assert mean == pytest.approx((20 * 0.12 - 2 * 0.06) / 96, rel=1e-5)
    assert microseconds > 0.0
    inner = GridGeometry(np.array([1.8, 0.8]), 0.02)
    assert measure(slope, data, inner, Interpolation.LINEAR)[1] < 1e-6


def test_table_ranks_finer_methods_better_on_smooth_surfaces():
    length = np.array([4.0, 4.0])
    title, _, *rows = table(GridGeometry(length, 0.1), GridGeometry(length, 0.05))
    assert title == "4 m x 4 m, interpolated from 0.1 m to 0.05 m"
    errors = {tuple(row.split()[:2]): float(row.split()[2]) for row in rows}
    assert [*errors] == [(world, method) for world in WORLDS for method in METHODS]
    for world in WORLDS:
        nearest, linear, convolution, cubic = (errors[world, method] for method in METHODS)
        assert nearest > 3 * linear > 3 * convolution >= 3 * cubic > 0.0


# --- the node -------------------------------------------------------------------------------------


def published(*arguments: str) -> tuple[list[GridMap], str]:
    """Return the maps of the three topics and the output of the demo."""
    with peer() as other:
        for topic in TOPICS:
            other.listen(topic, GridMapMessage)
        with running_node("grid_map_demos_py.interpolation_demo_node", *arguments) as demo:
            maps = [from_message(other.expect(topic)) for topic in TOPICS]
    return maps, demo.text


def test_demo_publishes_truth_samples_and_interpolation():
    (truth, data, found), text = published()
    assert (truth.size, data.size, found.size) == ((200, 200), (40, 40), (200, 200))
    assert (truth.layers, data.layers, found.layers) == (("demo",), ("demo",), ("demo", "error"))
    assert {grid_map.frame_id for grid_map in (truth, data, found)} == {"map"}
    x, y = truth.get_positions().T
    wave = np.cos(x) + np.sin(2 * y) + np.cos(3 * x) + np.sin(4 * y)
    np.testing.assert_allclose(truth["demo"].ravel("F"), wave, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(found["demo"], data["demo"].repeat(5, axis=0).repeat(5, axis=1))
    np.testing.assert_allclose(found["error"], np.abs(found["demo"] - truth["demo"]), atol=1e-6)
    assert "4 m x 4 m, interpolated from 0.1 m to 0.02 m" in text
    assert all(f"{world} " in text for world in WORLDS)


def test_world_method_extent_and_resolutions_are_parameters():
    given = ["world:=Poly", "interpolation_type:=Cubic", "world_size.length:=2"]
    given += ["world_size.width:=3.0", "groundtruth_resolution:=0.05"]
    given += ["interpolation.data_resolution:=0.2", "interpolation.interpolated_resolution:=0.04"]
    (truth, data, found), text = published(*parameters(*given))
    assert (truth.size, data.size, found.size) == ((40, 60), (10, 15), (50, 75))
    for grid_map in (truth, data):
        x, y = grid_map.get_positions().T
        height = -(x**2) - y**2 + 2 * x * y + x**2 * y**2
        np.testing.assert_allclose(grid_map["demo"].ravel("F"), height, rtol=1e-5, atol=1e-6)
    inner = found["error"][10:-10, 10:-10]
    assert 0.0 < inner.max() < 0.005
    assert "2 m x 3 m, interpolated from 0.2 m to 0.04 m" in text
