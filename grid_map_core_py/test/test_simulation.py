# SPDX-License-Identifier: BSD-3-Clause
"""Simulated sensors, compared with plane geometry and with samples along the beams."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from grid_map_core_py import GeometryError, GridMap, Interpolation, LayerNotFoundError
from grid_map_core_py._loops import Loop
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.simulation import (
    DepthCamera,
    SpinningLidar,
    cast_rays,
    scan,
    with_box,
    with_ramp,
    with_stairs,
)
from grid_map_core_py.testing import grid_maps, moved_in_buffer

DOWN = (0.0, 0.0, -1.0)


def terrain(function=lambda x, y: 0.0 * (x + y), side=4.0, resolution=0.1):
    """Return a map with heights that are a function of x and y."""
    grid_map = GridMap((side, 0.75 * side), resolution, layers=["elevation"])
    x, y = grid_map.axes()
    grid_map["elevation"] = function(x[:, None], y[None, :])
    return grid_map


@pytest.mark.usefixtures("way")
class TestRanges:
    def test_ramp(self):
        ramp = terrain(lambda x, y: 0.5 * x + 0.25 * y)
        beams = np.array([DOWN, (1.0, 0.0, 0.0), (0.0, 0.6, -0.8)])
        expected = [0.6, 1.2, 0.6 / 0.95]
        origin = 0.1, 0.2, 0.1 + 0.6
        np.testing.assert_allclose(cast_rays(ramp, origin, beams), expected, rtol=1e-6)

    def test_wall_is_as_steep_as_one_cell(self):
        wall = terrain(lambda x, y: np.where(x > 1.0, 2.0, 0.0) + 0 * y)
        ranges = cast_rays(wall, (0, 0, 0.5), [(1, 0, 0), (1, 0, 1), (1, 1, 0), (-1, 0, 0)])
        # It rises from 0 at x = 0.95 to 2 at x = 1.05; the second beam rises to 0.5 + x.
        expected = [0.975, math.sqrt(2) * 19.5 / 19, math.sqrt(2) * 0.975, np.nan]
        np.testing.assert_allclose(ranges, expected, rtol=1e-6)

    def test_saddle_is_met_at_the_first_root(self):
        saddle = GridMap((2, 2), 1.0, layers={"elevation": [[0, 1], [1, 0]]})
        beams = [(1, 1, 0), (1, -1, 0), (1, -1, 0)]
        origins = [(-0.5, -0.5, 0.375), (-0.5, 0.5, 0.375), (-0.25, 0.25, 0.7)]
        # Along the first diagonal the height is 2 u (1 - u), u from 0 to 1; along the other one,
        # 1 - 2 u (1 - u).
        expected = [0.25 * math.sqrt(2), np.nan, (0.25 + 0.5 * math.sqrt(0.4)) * math.sqrt(2)]
        np.testing.assert_allclose(cast_rays(saddle, origins, beams), expected, rtol=1e-12)

    def test_beams_from_beside_the_map(self):
        plateau = terrain(lambda x, y: 1.0 + 0 * x + 0 * y)
        beams = [(-1, 0, 0), (-1, 0, 0), (-1, 0, -0.5), (1, 0, 0), (-1, 9, 0)]
        origins = [(5, 0, 0.5), (5, 0, 1.5), (5, 0, 3), (5, 0, 0.5), (5, 0, 0.5)]
        expected = [3.0, np.nan, 4 * math.sqrt(1.25), np.nan, np.nan]
        np.testing.assert_allclose(cast_rays(plateau, origins, beams), expected)

    def test_holes_let_beams_through_to_the_side_of_the_ground(self):
        holed = terrain()
        holed["elevation"][15:25, :] = np.nan
        holed["elevation"][0, 0] = np.inf
        beams = [DOWN, DOWN, (1.0, 0.0, -1.0), DOWN]
        origins = [(0, 0, 1), (-1, 0, 1), (0, 0, 0.1), (1.99, 1.49, 1.0)]
        expected = [np.nan, 1.0, 0.55 * math.sqrt(2), np.nan]
        np.testing.assert_allclose(cast_rays(holed, origins, beams), expected)

    def test_no_return_beyond_max_range_from_below_and_of_nan(self):
        flat, beams = terrain(), [DOWN, DOWN, DOWN, DOWN, (0, 0, 0), (np.nan, 0, -1)]
        origins = [(0, 0, 1.0), (0, 0, 1.01), (0, 0, 0), (0, 0, -1), (0, 0, 1), (0, 0, 1)]
        ranges = cast_rays(flat, origins, beams, max_range=1.0)
        np.testing.assert_array_equal(ranges, [1.0, *[np.nan] * 5])

    def test_one_cell_and_no_ground_and_no_beams(self):
        cell = GridMap((1, 1), 1.0, layers={"elevation": 0.5})
        beams = [DOWN, DOWN, (-1, 0, 0)]
        origins = [(0.4, -0.4, 2.0), (0.6, 0.0, 2.0), (2, 0, 0.2)]
        np.testing.assert_allclose(cast_rays(cell, origins, beams), [1.5, np.nan, 1.5])
        cell["elevation"] = np.nan
        assert np.isnan(cast_rays(cell, origins, beams)).all()
        assert cast_rays(cell, (0, 0, 1), np.empty((0, 3))).shape == (0,)


@st.composite
def beams_over(draw, grid_map, *, from_centers=False):
    """Return origins and directions (20, 3) around a map, many along rows and columns."""
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    directions = random.normal(size=(20, 3)) * [1, 1, draw(st.sampled_from([0.0, 0.1, 1.0]))]
    directions[:6, 0] = directions[4:10, 1] = 0.0
    directions[12:, :2] = np.round(directions[12:, :2])
    spread = random.uniform(-0.8, 0.8, (20, 3)) * [*grid_map.length, 3000.0]
    origins = [*grid_map.position, 0.0] + spread
    if from_centers:
        origins[15:, :2] = grid_map.get_positions()[random.integers(0, np.prod(grid_map.size), 5)]
    return origins, directions


def heights_above(grid_map, points):
    """Return z of points (..., 3) above the surface; NaN beside the map, in and beside holes."""
    surface = GridMap.from_geometry(grid_map.geometry)
    surface["elevation"] = grid_map.unwrapped("elevation")
    surface["known"] = np.isfinite(surface["elevation"])
    above = np.full(points.shape[:-1], np.nan)
    inside = grid_map.is_inside(points[..., :2])
    x_y = points[inside][:, :2]
    heights = surface.at_position("elevation", x_y, Interpolation.LINEAR)
    # `at_position` takes the nearest cell in a hole.
    is_whole = surface.at_position("known", x_y, Interpolation.LINEAR) > 1.0 - 1e-9
    if not surface["known"].all():
        places = (x_y - surface.geometry.center_of((0, 0))) / surface.resolution
        is_whole &= (abs(places - np.round(places)) > 1e-6).all(axis=1)
    above[inside] = np.where(is_whole, points[inside][:, 2] - heights, np.nan)
    return above


@given(st.data(), grid_maps())
def test_beams_end_where_samples_first_reach_the_surface(data, grid_map):
    origins, directions = data.draw(beams_over(grid_map))
    ranges = cast_rays(grid_map, origins, directions)
    directions = directions / np.maximum(np.linalg.norm(directions, axis=1), 1e-9)[:, None]
    longest = np.where(np.isfinite(ranges), ranges - 1e-6, 3 * np.sum(grid_map.length))
    samples = np.linspace(0.0, np.maximum(longest, 0.0), 300)
    above = heights_above(grid_map, origins + samples[..., None] * directions)
    begins_in_ground = above[0] < 1e-3
    assert not (above < -1e-3).any(axis=0)[~begins_in_ground].any()
    ends = np.where(np.isfinite(ranges), ranges, 0.0)
    at_end = heights_above(grid_map, origins + ends[:, None] * directions)
    assert not (at_end[np.isfinite(ranges)] > 1e-3).any()


@given(st.data(), grid_maps(allow_moved=False))
def test_ranges_are_the_same_compiled_in_numpy_and_moved(data, grid_map):
    origins, directions = data.draw(beams_over(grid_map, from_centers=True))
    expected = cast_rays(grid_map, origins, directions)
    start = tuple(data.draw(st.integers(0, count - 1)) for count in grid_map.size)
    moved = moved_in_buffer(grid_map, start)
    np.testing.assert_array_equal(cast_rays(moved, origins, directions), expected)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Loop, "compiled", lambda _: None)
        np.testing.assert_array_equal(cast_rays(grid_map, origins, directions), expected)


def test_lidar_has_rings_at_elevation_angles():
    beams = SpinningLidar(rings=3, lowest=-0.2, highest=0.4, azimuths=4).directions
    assert beams.shape == (12, 3)
    np.testing.assert_allclose(np.linalg.norm(beams, axis=1), 1.0)
    np.testing.assert_allclose(np.arcsin(beams[:, 2]), np.repeat([-0.2, 0.1, 0.4], 4), atol=1e-12)
    np.testing.assert_allclose(beams[5], (0.0, math.cos(0.1), math.sin(0.1)), atol=1e-12)


def test_camera_has_pixels_in_its_field_of_view():
    camera = DepthCamera(width=5, height=3, angle=math.radians(90))
    beams = camera.directions.reshape(3, 5, 3)
    assert camera.focal_length == pytest.approx(2.5)
    np.testing.assert_allclose(beams[1, 2], (0, 0, 1), atol=1e-12)
    np.testing.assert_allclose(beams[0, 0], (-0.8, -0.4, 1.0))
    np.testing.assert_allclose(beams[2, 4], (0.8, 0.4, 1.0))


def looking_down(height):
    """Return the pose of a camera above the origin."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = height
    return pose


def test_scan_is_in_the_sensor_frame():
    beams = DepthCamera(width=20, height=10).directions
    points = scan(terrain(side=20.0), beams, looking_down(3.0))
    np.testing.assert_allclose(points, 3.0 * beams, rtol=1e-12)
    short = scan(terrain(side=20.0), beams, looking_down(3.0), max_range=3.5)
    returned = np.linalg.norm(points, axis=1) <= 3.5
    np.testing.assert_array_equal(np.isfinite(short), np.repeat(returned[:, None], 3, axis=1))


class Rods:
    """Model of a noise along one axis that grows with the depth, and of no measurement above."""

    along = np.array([1.0, 2.0, -1.0])

    def vertical_variances(self, points, distances, axis):  # noqa: ARG002
        variances = 0.01 * points[2] ** 2 * (axis @ self.along) ** 2
        return np.where(points[0] > 0.5, np.nan, variances)


def test_noise_has_the_covariance_of_the_model():
    beams = np.tile([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.3, 0.0, 1.0)], (20000, 1))
    random = np.random.default_rng(1)
    points = scan(terrain(), beams, looking_down(2.0), sensor=Rods(), random=random)
    assert np.isnan(points[1::3]).all()
    assert np.isnan(points[2::3]).all()
    noise = points[::3] - [0.0, 0.0, 2.0]
    expected = 0.04 * np.outer(Rods.along, Rods.along)
    np.testing.assert_allclose(np.cov(noise.T), expected, rtol=0.05)
    np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=0.01)


def test_box_covers_the_cells_under_it_and_nothing_else():
    ground = moved_in_buffer(terrain(lambda x, y: 0.1 * x + 0 * y), (7, 11))
    ground["other"] = 1.0
    original = ground.copy()
    box = with_box(ground, (0.5, -0.4), (1.0, 0.4), 0.8, yaw=0.5)
    assert ground == original
    along = np.array([math.cos(0.5), math.sin(0.5)])
    offsets = ground.get_positions() - (0.5, -0.4)
    under = (abs(offsets @ along) < 0.5) & (abs(offsets @ (-along[1], along[0])) < 0.2)
    changed, before = box["elevation"].ravel("F"), ground["elevation"].ravel("F")
    np.testing.assert_array_equal(changed != before, under)
    np.testing.assert_allclose(changed[under], before[under].mean() + 0.8, rtol=1e-6)


def test_objects_beside_the_map_or_on_unknown_ground():
    ground = terrain()
    assert with_box(ground, (90.0, 0.0), (1, 1), 1.0) == ground
    ground["elevation"] = np.nan
    box = with_box(ground, (0.0, 0.0), (1.0, 1.0), 1.0)["elevation"]
    assert (np.isfinite(box).sum(), np.nanmin(box), np.nanmax(box)) == (100, 1.0, 1.0)


def test_ramp_and_stairs_rise_along_their_length():
    ground = terrain()
    positions = np.column_stack([np.arange(-0.95, 1.0, 0.1), np.zeros(20)])
    ramp = with_ramp(ground, (0, 0), (2, 1), 0.6).at_position("elevation", positions)
    np.testing.assert_allclose(ramp, 0.3 * (positions[:, 0] + 1.0), atol=1e-6)
    stairs = with_stairs(ground, (0, 0), (2, 1), 0.6, 4).at_position("elevation", positions)
    np.testing.assert_allclose(stairs, np.repeat([0.15, 0.3, 0.45, 0.6], 5), rtol=1e-6)
    turned = with_stairs(ground, (0, 0), (2, 1), 0.6, 4, yaw=np.pi)
    np.testing.assert_allclose(turned.at_position("elevation", positions), stairs[::-1], rtol=1e-6)


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda: cast_rays(terrain(), (0, 0), [DOWN]), GeometryError, "origins"),
        (lambda: cast_rays(terrain(), (0, 0, 0), DOWN), GeometryError, "directions"),
        (lambda: cast_rays(terrain(), (0, 0, 0), [DOWN], max_range=0), GeometryError, "max_range"),
        (lambda: cast_rays(terrain(), (0, 0, 0), [DOWN], layer="a"), LayerNotFoundError, "'a'"),
        (lambda: scan(terrain(), [DOWN], np.eye(3)), GeometryError, "transform"),
        (lambda: SpinningLidar(rings=0), ConfigError, "rings"),
        (lambda: DepthCamera(height=0), ConfigError, "height"),
        (lambda: DepthCamera(angle=4.0), ConfigError, "angle"),
        (lambda: with_stairs(terrain(), (0, 0), (1, 1), 1.0, 0), GeometryError, "steps"),
        (lambda: with_box(terrain(), (0, np.nan), (1, 1), 1.0), GeometryError, "center"),
    ],
)
def test_wrong_arguments_are_named(call, error, text):
    with pytest.raises(error, match=text):
        call()
