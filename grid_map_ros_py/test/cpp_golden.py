# SPDX-License-Identifier: BSD-3-Clause
"""Messages that the C++ converters made from given maps, from `golden/`."""

import array
import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np

from grid_map_core_py import GridMap

_FILE = Path(__file__).parent / "golden" / "converters.json.gz"
with gzip.open(_FILE, "rt") as _stream:
    _GOLDEN: dict[str, Any] = json.load(_stream)


def cases(family: str) -> list[tuple[GridMap, dict[str, Any]]]:
    """Return (map, case) for every case of a converter."""
    found = []
    for case in _GOLDEN["cases"]:
        entries = case[family] if isinstance(case[family], list) else [case[family]]
        found += [(to_map(_GOLDEN["maps"][case["map"]]), entry) for entry in entries]
    assert found, family
    return found


def only(name: str) -> Any:
    """Return the golden data of a converter that does not depend on the map."""
    return _GOLDEN[name]


def to_map(described: dict[str, Any]) -> GridMap:
    layers = described["layers"]
    grid_map = GridMap(
        described["length"],
        described["resolution"],
        described["position"],
        {name: np.array(layers[name], dtype=np.float32) for name in described["layer_order"]},
        basic_layers=described["basic_layers"],
        frame_id=described["frame_id"],
        timestamp=described["timestamp"],
    )
    assert grid_map.size == tuple(described["size"])
    grid_map.start_index = described["start_index"]
    return grid_map


def to_grid(message: Any, described: dict[str, Any]) -> Any:
    """Fill an occupancy grid or a costmap, and return it."""
    header = described["header"]
    message.header.frame_id = header["frame_id"]
    message.header.stamp.sec, message.header.stamp.nanosec = header["sec"], header["nanosec"]
    info = message.info if "width" in described else message.metadata
    info.resolution = float(described["resolution"])
    info.origin.position.x, info.origin.position.y = map(float, described["origin"]["position"][:2])
    for name in described.keys() & {"width", "height", "size_x", "size_y"}:
        setattr(info, name, described[name])
    message.data = array.array(message.data.typecode, described["data"])
    return message


def assert_header(header: Any, described: dict[str, Any]) -> None:
    found = (header.frame_id, header.stamp.sec, header.stamp.nanosec)
    assert found == (described["frame_id"], described["sec"], described["nanosec"])


def assert_pose(pose: Any, described: dict[str, Any]) -> None:
    position, q = pose.position, pose.orientation
    assert [position.x, position.y, position.z] == described["position"]
    assert [q.x, q.y, q.z, q.w] == described["orientation_xyzw"]
