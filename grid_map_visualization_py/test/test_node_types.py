# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Messages of every type of visualization, published by the node over DDS."""

import gzip
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from nav_msgs.msg import GridCells, OccupancyGrid
from sensor_msgs.msg import Image, PointCloud2
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_core_py.testing import moved_in_buffer
from grid_map_ros_py import testing, to_message
from grid_map_ros_py.testing import Peer, running_node
from grid_map_visualization_py._registry import BUILT_IN

MODULE = "grid_map_visualization_py._executables.grid_map_visualization"
BOUND = 0.300000012
"""Resolution of the golden maps: 0.3 in single precision."""

PARAMETERS: dict[str, dict[str, Any]] = {
    "point_cloud": {"layer": "elevation"},
    "flat_point_cloud": {"height": 1},
    "vectors": {"layer_prefix": "n_", "position_layer": "elevation", "scale": 2},
    "occupancy_grid": {"layer": "elevation", "data_min": -BOUND, "data_max": BOUND},
    "grid_cells": {"layer": "elevation", "lower_threshold": -BOUND, "upper_threshold": BOUND},
    "map_region": {"color": 0x0000FF},
    "surface": {"color_map": "gray", "lower": 0, "upper": 3, "opacity": 0.5},
    "image": {"layer": "elevation", "color_map": "gray", "lower": 0, "upper": 3},
    "contours": {"layer": "elevation", "levels": [1, 2], "color": 0xFF0000},
}
MESSAGES = {
    "point_cloud": PointCloud2,
    "flat_point_cloud": PointCloud2,
    "vectors": Marker,
    "occupancy_grid": OccupancyGrid,
    "grid_cells": GridCells,
    "map_region": Marker,
    "surface": Marker,
    "image": Image,
    "contours": Marker,
}


@pytest.fixture
def peer() -> Iterator[Peer]:
    with testing.peer() as other:
        yield other


def arguments(tmp_path: Path, outputs: dict[str, Any], **others: object) -> list[str]:
    """Return the arguments that load a file with these visualizations."""
    parameters = {"grid_map_visualizations": [*outputs], **outputs, **others}
    path = tmp_path / "parameters.yaml"
    path.write_text(yaml.safe_dump({"grid_map_visualization": {"ros__parameters": parameters}}))
    return ["--ros-args", "--params-file", str(path)]


OUTPUTS = {name: {"type": name, "params": params} for name, params in PARAMETERS.items()}


def golden() -> tuple[GridMap, dict[str, Any]]:
    """Return a moved map and the messages that the C++ converters make from it."""
    path = Path(__file__).parent / "golden" / "converters.json.gz"
    content = json.loads(gzip.decompress(path.read_bytes()))
    (case,) = [case for case in content["cases"] if case["map"] == "C_15x11_moved"]
    described = content["maps"][case["map"]]
    grid_map = GridMap(
        described["length"],
        described["resolution"],
        described["position"],
        {name: np.array(described["layers"][name]) for name in described["layer_order"]},
        frame_id=described["frame_id"],
        timestamp=described["timestamp"],
    )
    grid_map.start_index = described["start_index"]
    return grid_map, case


def small_map() -> GridMap:
    """Return 2 x 2 cells of 1 m around (10, 0), stored from the last cell on."""
    elevation = [[0.0, 1.0], [2.0, 3.0]]
    layers = {"elevation": elevation, "n_x": 0.0, "n_y": 0.0, "n_z": 0.25}
    grid_map = GridMap((2, 2), 1.0, (10, 0), layers, frame_id="odom", timestamp=5_000_000_006)
    return moved_in_buffer(grid_map, (1, 1))


def points(message: Marker | GridCells) -> list[tuple[float, float, float]]:
    found = message.points if isinstance(message, Marker) else message.cells
    return [(p.x, p.y, p.z) for p in found]


def rgba(marker: Marker) -> np.ndarray:
    return np.array([(c.r, c.g, c.b, c.a) for c in marker.colors])


def fields_of(cloud: PointCloud2) -> np.ndarray:
    return np.frombuffer(cloud.data, "<f4").reshape(cloud.width, -1)


def assert_as_cpp(received: dict[str, list[Any]], case: dict[str, Any]) -> None:
    cloud, grid = received["point_cloud"][0], received["occupancy_grid"][0]
    (described,) = [e["cloud"] for e in case["to_point_cloud"] if len(e["layers"]) == 3]
    assert bytes(cloud.data).hex() == described["data_hex"]
    assert [f.name for f in cloud.fields] == [f["name"] for f in described["fields"]]
    assert (cloud.width, cloud.point_step) == (described["width"], described["point_step"])
    expected = case["to_occupancy_grid"][0]
    assert (expected["data_min"], expected["data_max"]) == (-BOUND, BOUND)
    assert list(grid.data) == expected["grid"]["data"]
    origin = grid.info.origin.position
    assert [origin.x, origin.y, origin.z] == expected["grid"]["origin"]["position"]
    expected = case["to_grid_cells"][0]
    assert (expected["lower"], expected["upper"]) == (-BOUND, BOUND)
    assert points(received["grid_cells"][0]) == [tuple(cell) for cell in expected["cells"]]


def assert_as_computed_by_hand(last: dict[str, Any]) -> None:
    for name, message in last.items():
        assert message.header.frame_id == "odom", name
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == (5, 6), name
    one, two, three, four = (10.5, 0.5, 0.0), (9.5, 0.5, 2.0), (10.5, -0.5, 1.0), (9.5, -0.5, 3.0)
    # The buffer starts with the cell at the smallest x and y.
    in_buffer = [four, three, two, one]

    cloud, flat = fields_of(last["point_cloud"]), fields_of(last["flat_point_cloud"])
    assert [f.name for f in last["point_cloud"].fields] == ["x", "y", "z", "n_x", "n_y", "n_z"]
    assert cloud.tolist() == [[*point, 0, 0, 0.25] for point in in_buffer]
    assert flat[:, -3:].tolist() == [[x, y, 1] for x, y, _ in in_buffer]

    assert list(last["occupancy_grid"].data) == [100, 100, 100, 50]
    assert points(last["grid_cells"]) == [(10.5, 0.5, 0.0)]
    expected = [end for x, y, z in in_buffer for end in ((x, y, z), (x, y, z + 0.5))]
    assert points(last["vectors"]) == expected
    assert rgba(last["vectors"]).tolist() == [[0, 1, 0, 1]] * 8
    corners = [(11, 1, 0), (11, -1, 0), (9, -1, 0), (9, 1, 0), (11, 1, 0)]
    assert points(last["map_region"]) == corners
    assert rgba(last["map_region"]).tolist() == [[0, 0, 1, 1]] * 5

    triangles = [one, two, three, two, four, three]
    assert points(last["surface"]) == triangles
    gray = {0.0: 0, 1.0: 85, 2.0: 170, 3.0: 255}
    shades = [[gray[z] / 255] * 3 + [0.5] for _, _, z in triangles]
    np.testing.assert_allclose(rgba(last["surface"]), shades, atol=1e-6)
    image = last["image"]
    assert (image.height, image.width, image.step, image.encoding) == (2, 2, 6, "rgb8")
    assert list(image.data) == [shade for z in (0.0, 1.0, 2.0, 3.0) for shade in [gray[z]] * 3]
    found = points(last["contours"])
    # The line at height 1 runs from the third cell to the middle of the first edge; 2 vice versa.
    expected_ends = {(10.5, -0.5, 1.0), (10.0, 0.5, 1.0), (9.5, 0.5, 2.0), (10.0, -0.5, 2.0)}
    assert (len(found), set(found)) == (4, expected_ends)
    assert rgba(last["contours"]).tolist() == [[1, 0, 0, 1]] * 4


def test_every_type_equals_cpp_and_a_manual_calculation(peer, tmp_path):
    assert PARAMETERS.keys() == MESSAGES.keys() == BUILT_IN.keys()
    grid_map, case = golden()
    without_normals = sorted(MESSAGES.keys() - {"vectors"})
    with running_node(MODULE, *arguments(tmp_path, OUTPUTS)) as node:
        for name, message_type in MESSAGES.items():
            peer.listen(name, message_type)
        peer.publish("/grid_map", to_message(grid_map))
        # The map lacks the layers of the vectors; the other outputs continue.
        for name in without_normals:
            peer.expect(name)
        assert not peer.received["vectors"]
        assert_as_cpp(peer.received, case)
        peer.publish("/grid_map", to_message(small_map()))
        for name in without_normals:
            peer.expect(name, 2)
        peer.expect("vectors")
        assert_as_computed_by_hand({name: peer.received[name][-1] for name in MESSAGES})
    (problem,) = node.lines[1:]
    assert "visualization 'vectors': no layer 'n_x'; available: elevation, full" in problem


def test_every_type_survives_a_map_without_its_layers(peer, tmp_path):
    needy = sorted(MESSAGES.keys() - {"flat_point_cloud", "map_region"})
    with running_node(MODULE, *arguments(tmp_path, OUTPUTS)) as node:
        for name, message_type in MESSAGES.items():
            peer.listen(name, message_type)
        peer.publish("/grid_map", to_message(GridMap((1, 1), 1.0, layers={"other": 1.0})))
        for name in ("flat_point_cloud", "map_region"):
            peer.expect(name)
        peer.wait_until(lambda: len(node.lines) == 1 + len(needy), "complaints")
        peer.publish("/grid_map", to_message(small_map()))
        for name in MESSAGES:
            peer.expect(name)
    for name in needy:
        assert f"visualization '{name}': no layer" in node.text


def test_misconfigured_visualizations_are_named_and_skipped_on_request(peer, tmp_path):
    outputs = {
        "wrong": {"type": "surface", "params": {"color_map": "virids"}},
        "region": {"type": "map_region"},
        "no topic": {"type": "map_region"},
    }
    with running_node(MODULE, *arguments(tmp_path, outputs, skip_invalid=True)) as node:
        peer.listen("region", Marker)
        peer.publish("/grid_map", to_message(small_map()))
        peer.expect("region")
        assert peer.node.count_publishers("wrong") == 0
    first, second, start = node.lines
    assert "skipped: visualization 'wrong' of type 'surface': parameter 'color_map'" in first
    assert "skipped: parameter 'grid_map_visualizations': " in second
    assert "'no topic'" in second
    assert "shows /grid_map as region, while" in start
