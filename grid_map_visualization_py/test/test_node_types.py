# SPDX-License-Identifier: BSD-3-Clause
"""Messages of every type of visualization, published by the node over DDS."""

from typing import Any

import numpy as np
from messages import colors_of, fields_of, points_of
from nav_msgs.msg import GridCells
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_core_py.testing import moved_in_buffer
from grid_map_ros_py import to_message
from grid_map_ros_py.testing import running_node
from grid_map_visualization_py._registry import BUILT_IN

MODULE = "grid_map_visualization_py._executables.grid_map_visualization"

PARAMETERS: dict[str, dict[str, Any]] = {
    "point_cloud": {"layer": "elevation"},
    "flat_point_cloud": {"height": 1},
    "vectors": {"layer_prefix": "n_", "position_layer": "elevation", "scale": 2},
    "occupancy_grid": {"layer": "elevation", "data_min": 0, "data_max": 2},
    "grid_cells": {"layer": "elevation", "lower_threshold": -1, "upper_threshold": 1},
    "map_region": {"color": 0x0000FF},
    "surface": {"color_map": "gray", "lower": 0, "upper": 3, "opacity": 0.5},
    "image": {"layer": "elevation", "color_map": "gray", "lower": 0, "upper": 3},
    "contours": {"layer": "elevation", "levels": [1, 2], "color": 0xFF0000},
}
MESSAGES = {name: visualization.message_type for name, visualization in BUILT_IN.items()}


def small_map() -> GridMap:
    """Return 2 x 2 cells of 1 m around (10, 0), stored from the last cell on."""
    elevation = [[0.0, 1.0], [2.0, 3.0]]
    layers = {"elevation": elevation, "n_x": 0.0, "n_y": 0.0, "n_z": 0.25}
    grid_map = GridMap((2, 2), 1.0, (10, 0), layers, frame_id="odom", timestamp=5_000_000_006)
    return moved_in_buffer(grid_map, (1, 1))


def tuples(message: Marker | GridCells) -> list[tuple[float, ...]]:
    return [*map(tuple, points_of(message).tolist())]


def assert_as_computed_by_hand(last: dict[str, Any]) -> None:
    for name, message in last.items():
        assert message.header.frame_id == "odom", name
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == (5, 6), name
    one, two, three, four = (10.5, 0.5, 0.0), (9.5, 0.5, 2.0), (10.5, -0.5, 1.0), (9.5, -0.5, 3.0)
    # The buffer starts with the cell at the smallest x and y.
    in_buffer = [four, three, two, one]

    names = "x", "y", "z", "n_x", "n_y", "n_z"
    cloud = fields_of(last["point_cloud"], *names)
    assert [field.name for field in last["point_cloud"].fields] == [*names]
    assert cloud.tolist() == [[*point, 0, 0, 0.25] for point in in_buffer]
    flat = fields_of(last["flat_point_cloud"], *"xyz")
    assert flat.tolist() == [[x, y, 1] for x, y, _ in in_buffer]

    assert list(last["occupancy_grid"].data) == [100, 50, 100, 0]
    assert tuples(last["grid_cells"]) == [(10.5, -0.5, 0.0), (10.5, 0.5, 0.0)]
    expected = [end for x, y, z in in_buffer for end in ((x, y, z), (x, y, z + 0.5))]
    assert tuples(last["vectors"]) == expected
    assert colors_of(last["vectors"]).tolist() == [[0, 1, 0, 1]] * 8
    corners = [(11, 1, 0), (11, -1, 0), (9, -1, 0), (9, 1, 0), (11, 1, 0)]
    assert tuples(last["map_region"]) == corners
    assert colors_of(last["map_region"]).tolist() == [[0, 0, 1, 1]] * 5

    triangles = [one, two, three, two, four, three]
    assert tuples(last["surface"]) == triangles
    gray = {0.0: 0, 1.0: 85, 2.0: 170, 3.0: 255}
    shades = [[gray[z] / 255] * 3 + [0.5] for _, _, z in triangles]
    np.testing.assert_allclose(colors_of(last["surface"]), shades, atol=1e-6)
    image = last["image"]
    assert (image.height, image.width, image.step, image.encoding) == (2, 2, 6, "rgb8")
    assert list(image.data) == [shade for z in (0.0, 1.0, 2.0, 3.0) for shade in [gray[z]] * 3]
    found = tuples(last["contours"])
    # The line at height 1 runs from the third cell to the middle of the first edge; 2 vice versa.
    expected_ends = {(10.5, -0.5, 1.0), (10.0, 0.5, 1.0), (9.5, 0.5, 2.0), (10.0, -0.5, 2.0)}
    assert (len(found), set(found)) == (4, expected_ends)
    assert colors_of(last["contours"]).tolist() == [[1, 0, 0, 1]] * 4


def test_every_type_equals_a_manual_calculation(peer, arguments):
    assert PARAMETERS.keys() == MESSAGES.keys()
    unmoved = GridMap((2, 2), 1.0, layers={"elevation": 1.0})
    without_normals = sorted(MESSAGES.keys() - {"vectors"})
    outputs = {name: {"type": name, "params": params} for name, params in PARAMETERS.items()}
    with running_node(MODULE, *arguments(grid_map_visualizations=[*outputs], **outputs)) as node:
        for name, message_type in MESSAGES.items():
            peer.listen(name, message_type)
        peer.publish("/grid_map", to_message(unmoved))
        # The map lacks the layers of the vectors; the other outputs continue.
        for name in without_normals:
            peer.expect(name)
        assert not peer.received["vectors"]
        peer.publish("/grid_map", to_message(small_map()))
        for name in without_normals:
            peer.expect(name, 2)
        peer.expect("vectors")
        assert_as_computed_by_hand({name: peer.received[name][-1] for name in MESSAGES})
    (problem,) = node.lines[1:]
    assert "visualization 'vectors': no layer 'n_x'; available: elevation" in problem


def test_misconfigured_visualizations_are_named_and_skipped_on_request(peer, arguments):
    outputs = {
        "wrong": {"type": "surface", "params": {"color_map": "virids"}},
        "region": {"type": "map_region"},
        "no topic": {"type": "map_region"},
    }
    parameters = {"grid_map_visualizations": [*outputs], "skip_invalid": True, **outputs}
    with running_node(MODULE, *arguments(**parameters)) as node:
        peer.listen("region", Marker)
        peer.publish("/grid_map", to_message(small_map()))
        peer.expect("region")
        assert peer.node.count_publishers("wrong") == 0
    first, second, start = node.lines
    assert "skipped: visualization 'wrong' of type 'surface': parameter 'color_map'" in first
    assert "skipped: parameter 'grid_map_visualizations': " in second
    assert "'no topic'" in second
    assert "shows /grid_map as /region, while" in start
