# SPDX-License-Identifier: BSD-3-Clause
"""Layers made of triangle meshes."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as arrays

from grid_map_core_py import GeometryError, GridMap, GridMapError
from grid_map_core_py.conversions import _mesh, from_mesh, rasterize_triangles
from grid_map_core_py.testing import grid_maps

SQUARE = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)


def hits_by_hand(grid_map, vertices, faces) -> np.ndarray:
    """Oracle: for each cell and triangle, solve for the point of the plane over the center."""
    layer = np.full(grid_map.size, np.nan)
    for index in np.ndindex(grid_map.size):
        point = grid_map.get_position(index)
        for face in faces:
            height = height_at(point, vertices[list(face)])
            if height is not None:
                layer[index] = np.fmax(layer[index], height)
    return layer


def height_at(point, corners) -> float | None:
    matrix = np.vstack([corners[:, :2].T, np.ones(3)])
    if not np.isfinite(corners).all() or abs(np.linalg.det(matrix)) < 1e-9:
        return None
    weights = np.linalg.solve(matrix, [*point, 1.0])
    return weights @ corners[:, 2] if (weights >= -1e-9).all() else None


@st.composite
def meshes(draw):
    """A map, and triangles whose corners are at or between its cell centers, or anywhere near."""
    grid_map = draw(grid_maps(max_side=7))
    # Quarters of cells are exact, so that both agree on centers that lie on an edge.
    quarters = arrays.arrays(np.int64, (draw(st.integers(3, 9)), 2), elements=st.integers(-8, 36))
    corner = grid_map.geometry.corner - 0.5 * grid_map.resolution
    xy = corner - 0.25 * grid_map.resolution * draw(quarters)
    heights = draw(arrays.arrays(np.float64, len(xy), elements=st.integers(-9, 9)))
    count = st.integers(0, 8)
    indices = st.integers(0, len(xy) - 1)
    faces = draw(arrays.arrays(np.int64, st.tuples(count, st.just(3)), elements=indices))
    return grid_map, np.column_stack([xy, heights]), faces


@given(meshes())
def test_the_highest_hit_equals_that_found_by_hand(case):
    grid_map, vertices, faces = case
    result = rasterize_triangles(vertices, faces, grid_map)
    expected = hits_by_hand(grid_map, vertices, faces)
    np.testing.assert_allclose(result["elevation"], expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4])
@pytest.mark.parametrize("offset", [0.0, 500_000.0])
def test_no_cell_is_missed_where_triangles_meet(dtype, angle, offset):
    """A turned mesh far from the origin, with cell centers on many of its edges."""
    steps = np.linspace(-3, 3, 25)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), 2 * x.ravel() - y.ravel()])
    turn = np.array([(np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))])
    vertices[:, :2] = vertices[:, :2] @ turn.T + (offset, -offset)
    first = np.arange(25 * 24).reshape(24, 25)[:, :-1].ravel()
    faces = np.vstack(
        [
            np.column_stack([first, first + 1, first + 26]),
            np.column_stack([first, first + 26, first + 25]),
        ]
    )
    grid_map = GridMap((4, 3.75), 0.125, (offset, -offset))
    result = rasterize_triangles(vertices.astype(dtype), faces, grid_map)["elevation"]
    xy = (grid_map.get_positions() - (offset, -offset)) @ turn
    expected = (2 * xy[:, 0] - xy[:, 1]).reshape(grid_map.size, order="F")
    tolerance = 1e-5 if dtype == np.float64 or offset == 0 else 0.15
    np.testing.assert_allclose(result, expected, atol=tolerance)


def test_polygons_are_cut_into_fans():
    angles = 2 * np.pi * np.arange(6) / 6
    vertices = np.column_stack([np.cos(angles), np.sin(angles), np.ones(6)])
    grid_map = GridMap((2, 2), 0.05)
    result = rasterize_triangles(vertices, [range(6)], grid_map)["elevation"]
    inside = np.ones(len(grid_map.get_positions()), bool)
    for angle in angles + np.pi / 6:
        normal = np.array([np.cos(angle), np.sin(angle)])
        inside &= grid_map.get_positions() @ normal <= np.cos(np.pi / 6) + 1e-9
    np.testing.assert_array_equal(np.isfinite(result).ravel("F"), inside)


def test_vertical_wall_is_hit_at_floor_and_roof_only():
    wall = [(0.25, -1, 0), (0.25, 1, 0), (0.25, 1, 5), (0.25, -1, 5)]
    grid_map = GridMap((2, 2), 0.5)
    assert np.isnan(rasterize_triangles(wall, [range(4)], grid_map)["elevation"]).all()
    steep = np.array(wall) + [(1e-4, 0, 0), (1e-4, 0, 0), (0, 0, 0), (0, 0, 0)]
    steep_heights = rasterize_triangles(steep, [range(4)], grid_map)["elevation"]
    assert np.nanmin(steep_heights) >= 0
    assert np.nanmax(steep_heights) <= 5


@pytest.mark.parametrize(("gap", "is_hit"), [(5e-10, True), (5e-9, False)])
def test_a_center_within_a_nanometer_of_an_edge_is_hit(gap, is_hit):
    """By a triangle so steep that its plane is far below its lowest corner there."""
    steep = [(gap, -1, 0), (gap, 1, 0), (gap + 1e-6, 0, 100)]
    heights = rasterize_triangles(steep, [(0, 1, 2)], GridMap((1, 1), 1.0))["elevation"]
    np.testing.assert_array_equal(heights, [[0.0 if is_hit else np.nan]])


@pytest.mark.parametrize("face", [(0, 1, 4), (0, 1, 5)])
def test_triangles_without_area_or_not_finite_are_not_hit(face):
    vertices = np.vstack([SQUARE, [(0, -1, 0), (0, np.nan, 0)]])
    assert np.isnan(rasterize_triangles(vertices, [face], GridMap((2, 2), 0.5))["elevation"]).all()


def test_one_huge_triangle_covers_every_cell():
    vertices = [(-1e7, -1e7, 1), (1e7, -1e7, 1), (0, 2e7, 1)]
    result = rasterize_triangles(vertices, [(0, 1, 2)], GridMap((20, 30), 0.1))
    assert (result["elevation"] == 1).all()


def test_large_and_small_triangles_give_the_same_heights(monkeypatch):
    generator = np.random.default_rng(5)
    corners = generator.uniform(-8, 8, (60, 3))
    corners[::7, :2] = np.round(corners[::7, :2])
    faces = generator.permutation(60).reshape(20, 3)
    grid_map = GridMap((12, 10), 0.1)
    grid_map.move((1.0, -0.5))
    layers = []
    for pairs in (1, 100, 1 << 13, 1 << 30):
        monkeypatch.setattr(_mesh, "_PAIRS", pairs)
        layers.append(rasterize_triangles(corners, faces, grid_map)["elevation"])
    assert all(np.array_equal(layer, layers[0], equal_nan=True) for layer in layers)


# Maps fitted to meshes


@pytest.mark.parametrize("resolution", [0.1, 0.3, 1.0, 5.0])
def test_a_map_made_to_fit_covers_the_mesh(resolution):
    vertices = np.vstack([SQUARE * (1, 2, 1) + (7, 3, 1), [(99, 99, 99), (np.nan, 0, 0)]])
    faces = [(0, 1, 2), (0, 2, 3), (0, 1, 5)]
    grid_map = from_mesh(vertices, faces, resolution, "z", frame_id="odom", timestamp=3)
    np.testing.assert_array_equal(
        grid_map.size, np.maximum(np.ceil(np.array([2, 4]) / resolution), 1)
    )
    np.testing.assert_allclose(grid_map.position, (7, 3))
    centers = grid_map.get_positions() - (7, 3)
    over = (np.abs(centers) <= (1 + 1e-9, 2 + 1e-9)).all(axis=1)
    np.testing.assert_array_equal(np.isfinite(grid_map["z"]).ravel("F"), over)
    assert (grid_map.frame_id, grid_map.timestamp) == ("odom", 3)


def test_a_mesh_without_extent_or_faces():
    wall = [(0.25, -1, 0), (0.25, 1, 0), (0.25, 1, 5)]
    assert from_mesh(wall, [(0, 1, 2)], 0.5).size == (1, 4)
    with pytest.raises(GridMapError, match="no face has a finite vertex"):
        from_mesh(SQUARE, np.empty((0, 3), int), 0.5)
    with pytest.raises(GeometryError, match="resolution"):
        from_mesh(SQUARE, [(0, 1, 2)], 0.0)


# Bad input


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (SQUARE[:, :2], [(0, 1, 2)], "vertices: expected x, y, z"),
        ("abc", [(0, 1, 2)], "vertices: expected numbers"),
        (SQUARE, [(0, 1)], r"faces: expected integers of shape \(F, 3\)"),
        (SQUARE, [0, 1, 2], r"faces: expected integers of shape \(F, 3\)"),
        (SQUARE, [(0.0, 1.0, 2.0)], "faces: expected integers"),
        (SQUARE, [(0, 1, 2), (0, 1, 2, 3)], "faces: expected the same number of vertices"),
        (SQUARE, [(0, 1, 4)], "faces: expected vertices from 0 to 3, got 0 to 4"),
        (SQUARE, [(-1, 1, 2)], "faces: expected vertices from 0 to 3, got -1 to 2"),
    ],
)
def test_invalid_mesh_is_refused(vertices, faces, message):
    grid_map = GridMap((1, 1), 0.5)
    with pytest.raises(GeometryError, match=message):
        rasterize_triangles(vertices, faces, grid_map)
    assert grid_map.layers == ()
