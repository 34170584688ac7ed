# SPDX-License-Identifier: BSD-3-Clause
"""Test of `planar_regions` with `PlanarTerrain`, run by test_optional_messages.py."""

import numpy as np
import pytest
from convex_plane_decomposition_msgs.msg import PlanarTerrain

from grid_map_core_py import GridMap
from grid_map_core_py.planes import PlanarRegions, extract_planes
from grid_map_core_py.testing import assert_maps_equal, moved_in_buffer
from grid_map_ros_py import from_message, from_pose, to_message
from grid_map_ros_py.testing import peer, running_node

MODULE = "grid_map_ros_py._executables.planar_regions"


def roof() -> GridMap:
    """Return a roof of two ramps with a hole, stored as if moved."""
    grid_map = GridMap((1.8, 1.2), 0.04, (5.0, -3.0), frame_id="odom", timestamp=10**9)
    x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
    grid_map["elevation"] = 1.0 - 0.3 * abs(x - 5.0) + 0.1 * y
    grid_map["elevation"][np.hypot(x - 5.5, y + 3.0) < 0.1] = np.nan
    return moved_in_buffer(grid_map, (5, 3))


def matches(message: PlanarTerrain, regions: PlanarRegions) -> bool:
    """Return whether the polygons, in the frame of the map, are those of the regions."""
    for found, region in zip(message.planar_regions, regions, strict=True):
        pose, boundary = from_pose(found.plane_parameters), found.boundary
        assert found.insets == [boundary]
        loops = boundary.outer_boundary, *boundary.holes
        for loop, expected in zip(loops, (region.outer, *region.holes), strict=True):
            flat = np.array([(point.x, point.y) for point in loop.points])
            points = flat @ pose[:3, :2].T + pose[:3, 3]
            np.testing.assert_allclose(points[:, :2], expected, atol=1e-6)
            np.testing.assert_allclose(points @ region.normal, region.offset, atol=1e-6)
        outer = np.array([(point.x, point.y) for point in loops[0].points])
        box = found.bbox2d
        corners = (box.min_x, box.min_y), (box.max_x, box.max_y)
        np.testing.assert_array_equal(corners, (outer.min(axis=0), outer.max(axis=0)))
    return True


@pytest.mark.parametrize("is_empty", [False, True])
def test_terrain_has_the_polygons_and_the_map(is_empty: bool) -> None:
    grid_map = roof()
    if is_empty:
        grid_map.clear("elevation")
    regions = extract_planes(grid_map)
    assert sorted(len(region.holes) for region in regions) == ([] if is_empty else [0, 1])
    with peer() as other, running_node(MODULE) as node:
        other.listen("/planar_terrain", PlanarTerrain)
        other.publish("/grid_map", to_message(grid_map))
        message = other.expect("/planar_terrain")
        assert matches(message, regions)
        expected = grid_map.with_start_index((0, 0)).with_layers(regions.layers())
        assert_maps_equal(from_message(message.gridmap), expected)
        assert "needs the package" not in node.text
        if is_empty:
            other.wait_until(lambda: "no planar regions on /grid_map" in node.text, "a warning")
