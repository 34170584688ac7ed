# SPDX-License-Identifier: BSD-3-Clause
"""Markers of planar regions; test/terrains.py has the test of `PlanarTerrain`."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from planes import is_on, points_of, regions_of, steps
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_core_py.planes import extract_planes
from grid_map_ros_py._planes import to_markers, triangles

HEADER = Header(frame_id="odom")


def terraces(seed: int, rows: int, cols: int) -> GridMap:
    """Return a map of random flat blocks with holes."""
    random = np.random.default_rng(seed)
    grid_map = GridMap.from_array(np.full((rows, cols), np.nan), 0.04)
    coarse = random.choice([0.0, 0.3, 0.6, np.nan], (rows // 6 + 1, cols // 7 + 1))
    heights = np.kron(coarse, np.ones((6, 7)))[:rows, :cols]
    heights[random.random((rows, cols)) < 0.03] = np.nan
    grid_map["elevation"] = heights
    return grid_map


@pytest.mark.needs("shapely")
@given(seed=st.integers(0, 10**6), rows=st.integers(1, 60), cols=st.integers(1, 60))
def test_triangles_cover_each_polygon_exactly_once(seed: int, rows: int, cols: int) -> None:
    import shapely

    regions = extract_planes(terraces(seed, rows, cols))
    corners, owners = triangles(regions.labels)
    assert set(owners) == {region.id for region in regions}
    x, y = regions.geometry.axes_in_map_order()
    for region in regions:
        row, col = np.moveaxis(corners[owners == region.id], -1, 0)
        own = shapely.polygons(np.stack([x[row], y[col]], axis=-1))
        assert shapely.is_ccw(shapely.get_exterior_ring(own)).all()
        assert shapely.area(own).sum() == pytest.approx(region.area)
        expected = shapely.Polygon(region.outer, region.holes)
        assert shapely.union_all(own).symmetric_difference(expected).area < 1e-9


def test_markers_replace_all_earlier_ones_and_lie_on_the_planes() -> None:
    regions = regions_of(steps())
    first, *markers = to_markers(regions, HEADER).markers
    assert (first.action, first.header) == (Marker.DELETEALL, HEADER)
    assert [marker.id for marker in markers] == [1, 1, 2, 2, 3, 3]
    assert sum(len(region.holes) for region in regions) == 1
    for region, fill, line in zip(regions, markers[::2], markers[1::2], strict=True):
        assert (fill.ns, fill.type) == ("regions", Marker.TRIANGLE_LIST)
        assert (line.ns, line.type) == ("outlines", Marker.LINE_LIST)
        assert fill.header == line.header == HEADER
        edges = points_of(line.points)
        assert is_on(region, points_of(fill.points))
        assert is_on(region, edges)
        np.testing.assert_allclose(edges[::2, :2], np.concatenate([region.outer, *region.holes]))
        assert {*map(tuple, edges[::2])} == {*map(tuple, edges[1::2])}
        assert line.scale.x > 0


def test_color_of_a_region_stays_with_its_id() -> None:
    before, after = steps(), steps(0.8, higher=False)
    first, second = (
        {marker.id: marker.color for marker in to_markers(regions, HEADER).markers[1::2]}
        for regions in (regions_of(before), regions_of(before, after))
    )
    kept = first.keys() & second.keys()
    assert 1 <= len(kept) < len(first) == 3
    assert all(first[each] == second[each] for each in kept)
    rgb = np.array([(color.r, color.g, color.b) for color in first.values()])
    gaps = np.linalg.norm(rgb[:, None] - rgb, axis=-1)
    assert gaps[~np.eye(3, dtype=bool)].min() > 0.3
