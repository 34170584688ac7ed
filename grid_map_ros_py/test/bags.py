# SPDX-License-Identifier: BSD-3-Clause
"""Small bags for tests, and paths of bags that the C++ rosbag2 recorded."""

from pathlib import Path

import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_ros_py.bags._storage import GRID_MAP_TYPE
from grid_map_ros_py.messages import to_serialized_message
from grid_map_ros_py.messages._definition import DEFINITION, TYPE_HASH

DATA = Path(__file__).parent / "data"
TOPIC = "/grid_map"
SECOND = 1_000_000_000


def numbered_map(number: int, side: int = 4) -> GridMap:
    """Return a map whose values and time [s] equal a number."""
    layers = {"elevation": float(number), "variance": np.nan}
    size = (0.1 * side, 0.1 * (side + 1))
    return GridMap(size, 0.1, layers=layers, frame_id="map", timestamp=number * SECOND)


def number_of(grid_map: GridMap) -> int:
    assert (grid_map["elevation"] == grid_map["elevation"][0, 0]).all()
    return int(grid_map["elevation"][0, 0])


def write_mcap(path: Path, times: list[int], *, schema: str = GRID_MAP_TYPE, **options) -> Path:
    """Write a file of numbered maps with the package `mcap` alone, in the order of `times` [s]."""
    mcap = pytest.importorskip("mcap.writer")
    channel = {"topic": TOPIC, "message_encoding": options.pop("encoding", "cdr")}
    for name, kind in (("index_types", mcap.IndexType), ("compression", mcap.CompressionType)):
        if name in options:
            options[name] = kind[options[name]]
    with path.open("wb") as file:
        writer = mcap.Writer(file, **options)
        writer.start("ros2", "test")
        key = writer.register_schema(schema, "ros2msg", b"")
        key = writer.register_channel(schema_id=key, **channel)
        for time in times:
            data = to_serialized_message(numbered_map(time))
            writer.add_message(key, time * SECOND, data, time * SECOND)
        writer.finish()
    return path


def write_bag(folder: Path, numbers: list[int], storage: str, *, compressed: str = "") -> Path:
    """Write a bag of numbered maps with the package `rosbags`."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    plugin = rosbag2.StoragePlugin[storage.upper()]
    writer = rosbag2.Writer(folder, version=9, storage_plugin=plugin)
    if compressed:
        mode = rosbag2.CompressionMode[compressed.upper()]
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer as bag:
        connection = bag.add_connection(TOPIC, GRID_MAP_TYPE, msgdef=DEFINITION, rihs01=TYPE_HASH)
        for number in numbers:
            data = to_serialized_message(numbered_map(number))
            bag.write(connection, number * SECOND, data)
    return folder
