# SPDX-License-Identifier: BSD-3-Clause
"""The move demo: data that stays in the frame, and data that moves with the map."""

from typing import Any

import numpy as np
import pytest
from demos import parameters

from grid_map_core_py import GridMap
from grid_map_demos_py.move_demo_node import make_map, place
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message
from grid_map_ros_py.testing import peer, running_node

MODULE = "move_demo_node"


def test_path_is_a_spiral_from_the_center():
    np.testing.assert_allclose(place(0.0), (0.0, 0.0))
    np.testing.assert_allclose(place(np.pi), (-0.03 * np.pi, 0.0), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(place(10.0)), 0.3)


def test_the_map_has_random_values_from_minus_one_to_one():
    grid_map = make_map()
    assert (grid_map.size, grid_map.layers) == ((70, 70), ("layer",))
    assert np.percentile(grid_map["layer"], [0, 50, 100]) == pytest.approx([-1, 0, 1], abs=0.1)
    assert not np.array_equal(make_map()["layer"], grid_map["layer"])


def test_move_keeps_data_in_place_and_position_moves_it():
    given = parameters("duration:=1.0", "publish_rate:=20.0")
    with peer() as other:
        messages = other.received.setdefault("/grid_map", [])
        other.listen("/grid_map", GridMapMessage)
        with running_node(f"grid_map_demos_py.{MODULE}", *given):
            other.wait_until(lambda: sum(map(has_lost, messages)) > 5, "a map that has moved")
            other.wait_until(lambda: sum(map(is_carried, messages)) > 5, "a map that was carried")
    carried = from_message(next(filter(is_carried, messages)))
    assert (carried.size, carried.resolution, carried.frame_id) == ((70, 70), 0.01, "map")
    for message in filter(is_carried, messages):
        np.testing.assert_array_equal(from_message(message)["layer"], carried["layer"])
    original = carried.copy()
    original.position = (0.0, 0.0)
    for message in filter(has_lost, messages):
        assert message.outer_start_index or message.inner_start_index
        assert_stayed(from_message(message), original)


def has_lost(message: Any) -> bool:
    """Return whether values have left the map."""
    return bool(np.isnan(message.data[0].data).any())


def is_carried(message: Any) -> bool:
    """Return whether all values are kept although the map has moved."""
    position = message.info.pose.position
    return np.hypot(position.x, position.y) > 0.01 and not has_lost(message)


def assert_stayed(grid_map: GridMap, original: GridMap) -> None:
    """Check that the remaining values are unchanged; values that left the map stay lost."""
    values = grid_map["layer"].ravel("F")
    known = np.isfinite(values)
    positions = grid_map.get_positions()
    assert not known[~original.is_inside(positions)].any()
    assert 0.7 < known.mean() < 1.0
    expected = original.at_position("layer", positions[known])
    np.testing.assert_array_equal(values[known], expected)


def test_move_and_position_take_turns():
    given = parameters("duration:=0.2")
    with peer() as other, running_node(f"grid_map_demos_py.{MODULE}", *given) as demo:
        other.wait_until(lambda: demo.text.count("position of the map") >= 4, "two turns of each")
    ways = [line.split("`")[1] for line in demo.lines if "position of the map" in line]
    assert ways[:4] == ["move", "position", "move", "position"]
