# SPDX-License-Identifier: BSD-3-Clause
"""Messages of planar regions, compared with plane equations and drawn polygons."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from planes import area_of, is_on, points_of, regions_of, steps
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_core_py.planes import extract_planes
from grid_map_ros_py import from_pose
from grid_map_ros_py._planes import (
    plane_frame,
    to_markers,
    to_polygons,
    to_terrain,
    triangles,
)

HEADER = Header(frame_id="odom")


def areas_of(corners: np.ndarray) -> np.ndarray:
    """Return the areas of triangles (T, 3, 2), negative for clockwise ones."""
    (a, b), (c, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return 0.5 * (a * d - b * c)


def terraces(seed: int, rows: int, cols: int) -> GridMap:
    """Return a map of random flat blocks with holes."""
    random = np.random.default_rng(seed)
    grid_map = GridMap.from_array(np.full((rows, cols), np.nan), 0.04)
    coarse = random.choice([0.0, 0.3, 0.6, np.nan], (rows // 6 + 1, cols // 7 + 1))
    heights = np.kron(coarse, np.ones((6, 7)))[:rows, :cols]
    heights[random.random((rows, cols)) < 0.03] = np.nan
    grid_map["elevation"] = heights
    return grid_map


@given(seed=st.integers(0, 10**6), rows=st.integers(1, 60), cols=st.integers(1, 60))
def test_triangles_cover_each_polygon_exactly_once(seed: int, rows: int, cols: int) -> None:
    regions = extract_planes(terraces(seed, rows, cols))
    corners, owners = triangles(regions.labels)
    assert set(owners) == {region.id for region in regions}
    x, y = regions.geometry.axes_in_map_order()
    for region in regions:
        own = corners[owners == region.id]
        assert (areas_of(own) > 0).all()
        assert areas_of(own).sum() * 0.04**2 == pytest.approx(region.area)
        loops = [
            np.stack([x[0] - loop[:, 0], y[0] - loop[:, 1]], axis=1) / 0.04
            for loop in (region.outer, *region.holes)
        ]
        filled = [drawn([triangle], (rows, cols)) for triangle in own]
        np.testing.assert_array_equal(np.any(filled, axis=0), drawn(loops, (rows, cols)))


def drawn(loops: list[np.ndarray], size: tuple[int, int]) -> np.ndarray:
    """Return which of four points in each block of 2 x 2 cells are inside (even-odd rule)."""
    rows, cols = 0.5 * np.mgrid[: 2 * size[0], : 2 * size[1]]
    # No edge goes through these points.
    rows, cols = rows + 0.25, cols + 0.27
    inside = np.zeros(rows.shape, np.bool_)
    for loop in loops:
        for (r, c), (to_r, to_c) in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            if r != to_r:
                crossed = (r > rows) != (to_r > rows)
                inside ^= crossed & (cols < c + (rows - r) / (to_r - r) * (to_c - c))
    return inside


def test_markers_replace_all_earlier_ones_and_lie_on_the_planes() -> None:
    regions = regions_of(steps())
    first, *markers = to_markers(regions, HEADER).markers
    assert (first.action, first.header) == (Marker.DELETEALL, HEADER)
    assert [marker.id for marker in markers] == [1, 1, 2, 2, 3, 3]
    for region, fill, line in zip(regions, markers[::2], markers[1::2], strict=True):
        assert (fill.ns, fill.type) == ("regions", Marker.TRIANGLE_LIST)
        assert (line.ns, line.type) == ("outlines", Marker.LINE_LIST)
        assert fill.header == line.header == HEADER
        corners, edges = points_of(fill.points), points_of(line.points)
        assert is_on(region, corners)
        assert is_on(region, edges)
        areas = areas_of(corners[:, :2].reshape(-1, 3, 2))
        assert areas.sum() == pytest.approx(region.area)
        vertices = np.concatenate([region.outer, *region.holes])
        np.testing.assert_allclose(edges[::2, :2], vertices)
        assert {*map(tuple, edges[::2])} == {*map(tuple, edges[1::2])}
        assert line.scale.x > 0
    assert sum(len(region.holes) for region in regions) == 1


def test_color_of_a_region_stays_with_its_id() -> None:
    before, after = steps(), steps(0.8, higher=False)
    colors = [
        {marker.id: marker.color for marker in to_markers(regions, HEADER).markers[1::2]}
        for regions in (regions_of(before), regions_of(before, after))
    ]
    assert len(colors[0]) == 3
    kept = colors[0].keys() & colors[1].keys()
    assert 1 <= len(kept) < 3
    assert all(colors[0][each] == colors[1][each] for each in kept)
    rgb = [(color.r, color.g, color.b) for color in colors[0].values()]
    gaps = np.linalg.norm(np.subtract.outer(rgb, rgb).diagonal(axis1=1, axis2=3), axis=-1)
    assert gaps[~np.eye(3, dtype=bool)].min() > 0.3


def test_polygons_are_the_outer_ones_on_the_planes() -> None:
    regions = regions_of(steps())
    for region, message in zip(regions, to_polygons(regions, HEADER), strict=True):
        assert message.header == HEADER
        points = points_of(message.polygon.points)
        np.testing.assert_allclose(points[:, :2], region.outer, atol=1e-6)
        assert is_on(region, points)


def message_package() -> SimpleNamespace:
    """Return a stand-in for the messages of `PlanarTerrain`."""
    names = "PlanarTerrain PlanarRegion BoundingBox2d PolygonWithHoles2d Polygon2d Point2d"
    kinds = {name: type(name, (SimpleNamespace,), {}) for name in names.split()}
    kinds["PlanarTerrain"] = lambda gridmap: SimpleNamespace(gridmap=gridmap, planar_regions=[])
    return SimpleNamespace(**kinds)


def test_terrain_polygons_are_in_the_frames_of_their_planes() -> None:
    regions = regions_of(steps())
    terrain = to_terrain(regions, "the map", message_package())
    assert terrain.gridmap == "the map"
    for region, message in zip(regions, terrain.planar_regions, strict=True):
        pose = from_pose(message.plane_parameters)
        np.testing.assert_allclose(pose[:3, 2], region.normal, atol=1e-9)
        np.testing.assert_allclose(pose[:3, 3], region.center)
        assert pose[0, 0] > 0
        assert pose[1, 0] == pytest.approx(0.0, abs=1e-9)
        assert message.insets == [message.boundary]
        loops = [message.boundary.outer_boundary, *message.boundary.holes]
        for expected, loop in zip((region.outer, *region.holes), loops, strict=True):
            flat = np.array([(point.x, point.y) for point in loop.points])
            points = np.c_[flat, np.zeros(len(flat)), np.ones(len(flat))] @ pose.T
            np.testing.assert_allclose(points[:, :2], expected, atol=1e-9)
            assert is_on(region, points[:, :3])
            assert np.sign(area_of(flat)) == np.sign(area_of(expected))
        outer = np.array([(point.x, point.y) for point in loops[0].points])
        box = message.bbox2d
        np.testing.assert_array_equal(outer.min(axis=0), (box.min_x, box.min_y))
        np.testing.assert_array_equal(outer.max(axis=0), (box.max_x, box.max_y))


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (-0.48, 0.6, 0.64)])
def test_plane_frame_is_a_rotation(normal: tuple[float, float, float]) -> None:
    region = SimpleNamespace(normal=np.array(normal), center=np.array([1.0, 2.0, 3.0]))
    matrix = plane_frame(region)
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1.0)


@pytest.mark.parametrize("heights", [np.full((7, 5), np.nan), np.zeros((1, 1)), np.zeros((1, 9))])
def test_map_without_regions_only_deletes_markers(heights: np.ndarray) -> None:
    regions = regions_of(GridMap.from_array(heights, 0.04))
    assert [marker.action for marker in to_markers(regions, HEADER).markers] == [Marker.DELETEALL]
    assert to_polygons(regions, HEADER) == []
    assert to_terrain(regions, None, message_package()).planar_regions == []
