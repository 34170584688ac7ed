# SPDX-License-Identifier: BSD-3-Clause
"""Maps as surfaces of triangles, against loops over the cells."""

from itertools import pairwise

import messages
import numpy as np
import pytest
from hypothesis import given, settings
from messages import colors_of, points_of
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap, color_vector_to_value
from grid_map_core_py.testing import grid_maps
from grid_map_visualization_py.colors import Coloring
from grid_map_visualization_py.surface import Mesh, Surface

GRAY = Coloring("flat", color=0x102030)


def drawn(grid_map: GridMap, **params: object) -> Marker:
    return messages.drawn("surface", grid_map, **params)


def corners_of(mesh: Mesh) -> np.ndarray:
    """Return the corners (T, 3, 3) of the triangles, map frame."""
    return mesh.vertices[mesh.faces].astype(np.float64) + mesh.origin


def area_seen_from_above(triangles: np.ndarray) -> np.ndarray:
    """Return the doubled signed areas, positive for counter-clockwise corners."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]


@settings(max_examples=60)
@given(grid_maps(("z",), max_side=6))
def test_squares_become_triangles_along_the_flatter_diagonal(grid_map):
    expected = expected_triangles(grid_map.unwrapped("z"))
    assert triangles_of(grid_map) == expected
    mesh = Surface(grid_map, "z").mesh(GRAY)
    corners = corners_of(mesh)
    assert len(corners) == len(expected)
    cell_area = grid_map.resolution**2
    np.testing.assert_allclose(area_seen_from_above(corners), cell_area, rtol=1e-3)
    assert np.isfinite(mesh.vertices).all()
    assert len(mesh.vertices) == len(mesh.colors) == np.count_nonzero(np.isfinite(grid_map["z"]))
    marker = points_of(drawn(grid_map, height_layer="z"))
    np.testing.assert_allclose(marker, corners.reshape(-1, 3), rtol=1e-5, atol=1e-5)


def expected_triangles(heights: np.ndarray) -> set[frozenset[tuple[int, int]]]:
    """Return the corners, row and column, of all triangles, by a loop over the squares."""
    found = set()
    for row, column in np.ndindex(*np.subtract(heights.shape, 1)):
        a, b, c, d = square = [(row + i, column + j) for i in (0, 1) for j in (0, 1)]
        known = [cell for cell in square if np.isfinite(heights[cell])]
        if len(known) == 4:
            # The flatter diagonal, or else the higher one, or else the one from b to c.
            ends = {(i, j): (heights[i], heights[j]) for i, j in ((b, c), (a, d))}
            k, m = min(ends, key=lambda pair: (abs(np.subtract(*ends[pair])), -sum(ends[pair])))
            halves = [(k, m, cell) for cell in square if cell not in (k, m)]
            found |= set(map(frozenset, halves))
        elif len(known) == 3:
            found.add(frozenset(known))
    return found


def triangles_of(grid_map: GridMap) -> set[frozenset[tuple[int, int]]]:
    columns, rows = np.divmod(Surface(grid_map, "z").triangles, grid_map.size[0])
    return {frozenset(map(tuple, corners)) for corners in np.stack([rows, columns], -1).tolist()}


@pytest.mark.parametrize("turn", [np.asarray, np.fliplr])
def test_ridges_along_either_diagonal_stay_straight(turn):
    row, column = np.indices((7, 7))
    heights = turn(-abs(row - column).astype(np.float32))
    triangles = triangles_of(GridMap((7, 7), 1.0, layers={"z": heights}))
    on_ridge = sorted(map(tuple, np.argwhere(heights == 0).tolist()))
    for ends in pairwise(on_ridge):
        assert sum(set(ends) <= corners for corners in triangles) == 2


def test_flat_color_and_opacity_are_those_of_all_triangles():
    grid_map = GridMap((2, 2), 1.0, layers={"z": 0.0}, frame_id="odom")
    paint = {"color_mode": "flat", "color_layer": "not needed", "color": 0xFF8000, "opacity": 0.5}
    marker = drawn(grid_map, height_layer="z", **paint)
    expected = np.array([1.0, 128 / 255, 0.0, 0.5], np.float32)
    np.testing.assert_allclose(colors_of(marker), np.tile(expected, (6, 1)), rtol=1e-6)
    assert (marker.type, marker.action, marker.ns) == (Marker.TRIANGLE_LIST, Marker.ADD, "surface")
    assert (marker.scale.x, marker.scale.y, marker.scale.z) == (1.0, 1.0, 1.0)
    assert (marker.header.frame_id, marker.pose.orientation.w) == ("odom", 1.0)


def test_flat_surface_has_the_holes_of_its_heights():
    grid_map = GridMap((3, 3), 1.0, layers={"z": 7.0})
    grid_map["z"][0, 0] = np.nan
    points = points_of(drawn(grid_map, height_layer="z", flat=True))
    assert len(points) == 3 * 7
    assert (points[:, 2] == 0).all()


def test_vertices_of_a_map_far_away_keep_their_precision():
    grid_map = GridMap((0.4, 0.4), 0.1, (1e7, -3e7), {"z": 1.0})
    mesh = Surface(grid_map, "z").mesh(GRAY)
    assert mesh.origin.tolist() == [1e7, -3e7, 0.0]
    np.testing.assert_allclose(np.unique(mesh.vertices[:, 0]), [-0.15, -0.05, 0.05, 0.15], 1e-5)
    assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float32, np.uint32)
    assert mesh.colors.dtype == np.uint8


# --- colors --------------------------------------------------------------------------------------


def color_at(marker: Marker, x: float, y: float) -> np.ndarray:
    """Return the color (4,) of the corners at a position."""
    found = colors_of(marker)[(points_of(marker)[:, :2] == (x, y)).all(axis=1)]
    assert len(found)
    assert (found == found[0]).all()
    return found[0]


def test_colors_come_from_heights_or_the_color_layer():
    grid_map = GridMap((2, 2), 1.0, layers={"z": [[0, 1], [2, 3]], "s": [[5, 5], [5, 6]]})
    black, white = [0, 0, 0, 1], [1, 1, 1, 1]
    by_height = drawn(grid_map, height_layer="z", color_map="gray")
    assert color_at(by_height, 0.5, 0.5).tolist() == black
    assert color_at(by_height, -0.5, -0.5).tolist() == white
    by_layer = drawn(grid_map, height_layer="z", color_layer="s", color_map="gray", invert=True)
    assert color_at(by_layer, 0.5, 0.5).tolist() == white
    assert color_at(by_layer, -0.5, -0.5).tolist() == black
    fixed = drawn(grid_map, height_layer="z", color_map="gray", lower=0, upper=1.5)
    assert color_at(fixed, -0.5, 0.5).tolist() == white
    assert color_at(fixed, 0.5, -0.5)[0] == pytest.approx(2 / 3, abs=1 / 255)


def test_packed_colors_are_shown_unchanged():
    colors = color_vector_to_value([[(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (0, 0, 0)]])
    grid_map = GridMap((2, 2), 1.0, layers={"z": 0.0, "color": colors})
    marker = drawn(grid_map, height_layer="z", color_mode="color", color_layer="color")
    assert color_at(marker, 0.5, 0.5).tolist() == [1, 0, 0, 1]
    assert color_at(marker, 0.5, -0.5).tolist() == [0, 1, 0, 1]


# --- large maps -----------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(40, 40), (100, 7), (1000, 1), (5, 3), (3, 3)])
@pytest.mark.parametrize("max_drawn_cells", [9, 30, 400])
def test_thinned_out_map_keeps_its_extent_and_its_values(size, max_drawn_cells):
    random = np.random.default_rng(3)
    grid_map = GridMap(size, 1.0, (0.3, 0.9), {"z": random.random(size)})
    mesh = Surface(grid_map, "z", max_drawn_cells=max_drawn_cells).mesh(Coloring())
    assert len(mesh.vertices) <= max_drawn_cells
    cells = np.prod(size)
    assert len(mesh.vertices) >= (max_drawn_cells / 16 if cells > max_drawn_cells else cells)
    positions = mesh.vertices[:, :2] + mesh.origin[:2]
    np.testing.assert_allclose(positions.max(axis=0), grid_map.geometry.corner - 0.5, atol=1e-4)
    np.testing.assert_allclose(np.ptp(positions, axis=0), np.array(size) - 1.0, atol=1e-4)
    values = grid_map.at_position("z", positions)
    np.testing.assert_array_equal(values.astype(np.float32), mesh.vertices[:, 2])


def test_colors_of_thinned_out_map_have_bounds_of_all_cells():
    grid_map = GridMap((40, 40), 1.0, layers={"z": np.linspace(0.0, 1.0, 1600).reshape(40, 40)})
    grid_map["z"][20, 20] = 100.0
    surface = Surface(grid_map, "z", max_drawn_cells=100)
    assert np.nanmax(surface.values("z")) < 100
    assert surface.bounds(Coloring()) == (0.0, 100.0)
    assert surface.mesh(Coloring(color_map="gray")).colors.max() <= 3


def test_thinned_out_map_that_moves_keeps_the_cells_inside():
    grid_map = GridMap((40, 30), 1.0, layers={"z": 0.0})
    grid_map["z"] = np.random.default_rng(2).random((40, 30))

    def shown() -> set[tuple[float, ...]]:
        """Return the positions of the kept cells, away from the borders."""
        mesh = Surface(grid_map, "z", max_drawn_cells=200).mesh(GRAY)
        positions = mesh.vertices[:, :2] + mesh.origin[:2]
        return {(x, y) for x, y in positions.tolist() if abs(x) < 16 and abs(y) < 11}

    before = shown()
    grid_map.move((1.0, 1.0))
    assert len(before) > 50
    assert shown() == before
