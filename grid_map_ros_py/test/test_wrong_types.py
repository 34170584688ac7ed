# SPDX-License-Identifier: BSD-3-Clause
"""Arguments of another type than the message of a conversion."""

from collections.abc import Callable

import pytest
from sensor_msgs.msg import Image

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import (
    MessageError,
    from_costmap,
    from_grid_cells,
    from_image,
    from_message,
    from_occupancy_grid,
    from_octomap,
    from_point_cloud,
    from_polygon,
    from_serialized_message,
    octomap_to_points,
    read_points,
)

MAP = GridMap((1, 1), 0.5, layers={"elevation": 0.0})

READERS: dict[Callable[[object], object], str] = {
    from_message: "grid_map_msgs/GridMap",
    from_polygon: "geometry_msgs/PolygonStamped",
    from_octomap: "octomap_msgs/Octomap",
    octomap_to_points: "octomap_msgs/Octomap",
    read_points: "sensor_msgs/PointCloud2",
    lambda message: from_point_cloud(message, resolution=1.0): "sensor_msgs/PointCloud2",
    lambda message: from_occupancy_grid(message, "e"): "nav_msgs/OccupancyGrid",
    lambda message: from_grid_cells(message, "e"): "nav_msgs/GridCells",
    lambda message: from_image(message, "e", 1.0): "sensor_msgs/Image",
    lambda message: from_costmap(message, "e"): "nav2_msgs/Costmap or a PyCostmap2D",
}


@pytest.mark.parametrize(("read", "kind"), READERS.items(), ids=READERS.values())
@pytest.mark.parametrize(
    ("argument", "found"),
    [
        (MAP, "grid_map_core_py.GridMap"),
        (Image(), "sensor_msgs.Image"),
    ],
    ids=lambda one: one if isinstance(one, str) else "",
)
def test_other_types_than_the_message_are_named(
    read: Callable[[object], object], kind: str, argument: object, found: str
) -> None:
    if found.replace(".", "/") == kind:
        return
    with pytest.raises(MessageError) as error:
        read(argument)
    assert str(error.value) == f"message: expected a {kind}, got {found!r}"


@pytest.mark.parametrize("argument", [MAP, GridMapMessage(), "text", None])
def test_bytes_of_message_are_bytes(argument: object) -> None:
    with pytest.raises(MessageError, match="data: expected the bytes of a serialized message, got"):
        from_serialized_message(argument)
