# SPDX-License-Identifier: BSD-3-Clause
"""Messages and bags that claim much are refused before they take memory, by library and nodes."""

from collections.abc import Callable
from typing import Any

import pytest
from bags import TOPIC, numbered_map, write_bag

from conftest import peak_memory
from grid_map_core_py import GridMap, GridMapError, LimitError
from grid_map_core_py.limits import changed_limits
from grid_map_ros_py import (
    from_costmap,
    from_grid_cells,
    from_image,
    from_message,
    from_occupancy_grid,
    from_point_cloud,
    from_serialized_message,
    load_from_bag,
    load_octomap,
    save_to_bag,
    to_costmap,
    to_grid_cells,
    to_image,
    to_message,
    to_occupancy_grid,
    to_point_cloud,
    to_serialized_message,
)

SMALL = numbered_map(1)
"""A map of 4 x 5 cells."""
CELLS = r"expected at most 19 cells, got [45] x [45]"


READERS: dict[str, Callable[[], Any]] = {
    "GridMap": lambda: from_message(to_message(SMALL)),
    "bytes": lambda: from_serialized_message(to_serialized_message(SMALL, [])),
    "OccupancyGrid": lambda: from_occupancy_grid(to_occupancy_grid(SMALL, "elevation", 0, 1), "a"),
    "Costmap": lambda: from_costmap(to_costmap(SMALL, "elevation"), "a"),
    "GridCells": lambda: from_grid_cells(to_grid_cells(SMALL, "elevation", 0, 9), "a"),
    "Image": lambda: from_image(to_image(SMALL, "elevation", "mono8"), "a", 0.1),
    "PointCloud2": lambda: from_point_cloud(
        to_point_cloud(SMALL, "elevation"), resolution=0.1, tight=True
    ),
}


@pytest.mark.usefixtures("nav2")
@pytest.mark.parametrize("kind", READERS)
def test_maps_of_messages_have_at_most_max_cells(kind):
    with changed_limits(max_cells=19), pytest.raises(LimitError, match=CELLS):
        READERS[kind]()
    with changed_limits(max_cells=20):
        assert READERS[kind]().size == SMALL.size


def test_octomap_file_beyond_the_limit_is_not_read(tmp_path):
    (tmp_path / "a.bt").write_bytes(bytes(1001))
    text = r"a\.bt: file: expected at most 1000 bytes, got 1001"
    with changed_limits(max_bytes=1000), pytest.raises(LimitError, match=text):
        load_octomap(tmp_path / "a.bt")


@pytest.mark.needs("mcap", "zstandard", "rosbags")
def test_bag_with_a_map_beyond_the_limit_names_the_map(tmp_path):
    save_to_bag(SMALL, tmp_path / "bag", TOPIC)
    with changed_limits(max_cells=19), pytest.raises(LimitError, match=rf"bag.*map 0.*{CELLS}"):
        load_from_bag(tmp_path / "bag", TOPIC)


def test_few_bytes_cannot_claim_many_cells():
    data = to_serialized_message(GridMap((30_000, 30_000), 1.0, frame_id="map"))
    assert len(data) < 200

    def read() -> None:
        with pytest.raises(LimitError, match="expected at most 16000000 cells"):
            from_serialized_message(data)

    assert peak_memory(read) < 1e6


@pytest.mark.needs("mcap", "zstandard", "rosbags")
def test_packed_message_is_unpacked_up_to_the_limit(tmp_path):
    folder = write_bag(tmp_path / "bag", [1], "sqlite3", compressed="message")
    assert load_from_bag(folder, TOPIC) == SMALL
    text = "a message: expected at most 300 bytes, got 436"
    with changed_limits(max_bytes=300), pytest.raises(LimitError, match=text):
        load_from_bag(folder, TOPIC)


@pytest.mark.parametrize(
    "change",
    [
        lambda m, names: setattr(m, "layers", names),
        lambda m, names: (setattr(m, "layers", names), setattr(m, "data", m.data[:1] * len(names))),
        lambda m, names: setattr(m, "basic_layers", names),
    ],
)
def test_many_layer_names_are_refused(change):
    # Comparing each name with each other one would take minutes.
    message = to_message(SMALL)
    change(message, [f"layer {number // 2}" for number in range(200_000)])
    with pytest.raises(GridMapError):
        from_message(message)
