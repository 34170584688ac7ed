# SPDX-License-Identifier: BSD-3-Clause
"""Footprints: the cells that they touch, checks of poses and paths, and layers."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from grid_map_core_py import GeometryError, LimitError, Polygon
from grid_map_core_py.planning import Footprint
from grid_map_core_py.planning._footprint import free_poses, touched_runs

ROBOT = Footprint.rectangle(0.9, 0.5)
ELL = Footprint([(0.0, 0.0), (0.7, 0.0), (0.7, 0.2), (0.2, 0.2), (0.2, 0.6), (0.0, 0.6)])
FORK = Footprint([(-0.3, 0), (0.5, -0.3), (0.5, -0.2), (0.0, 0.0), (0.5, 0.2), (0.5, 0.3)])
MARGIN = 2e-9
"""Distance [m] within which a footprint only touches a cell, which counts or not."""


def corners_at(footprint, pose):
    x, y, yaw = pose
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    return footprint.points @ turn.T + (x, y)


def meets_square(corners, center, half):
    """Oracle: an edge is partly in the square, or the center of the square is in the polygon."""
    if half <= 0:
        return False
    for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        # Clip the edge to the two strips that contain the square (Liang and Barsky).
        enter, leave = 0.0, 1.0
        for start, along in zip(begin - center, end - begin, strict=True):
            if along == 0:
                enter, leave = (enter, leave) if abs(start) < half else (1.0, 0.0)
                continue
            crossings = sorted([(-half - start) / along, (half - start) / along])
            enter, leave = max(enter, crossings[0]), min(leave, crossings[1])
        if enter < leave:
            return True
    return bool(Polygon(corners).is_inside(center))


def touched_by_hand(corners, centers, resolution):
    """Return the numbers of the cells that are surely touched, and of those that may count."""
    surely, perhaps = (
        {
            number
            for number, center in enumerate(centers)
            if meets_square(corners, center, 0.5 * resolution + margin)
        }
        for margin in (-MARGIN, MARGIN)
    )
    return surely, perhaps


@st.composite
def footprints(draw):
    """Stars around a point: convex or not, some without the origin inside."""
    count = draw(st.integers(3, 9))
    angles = 2 * np.pi * (np.arange(count) + draw(st.floats(0, 0.9))) / count
    radii = draw(st.lists(st.floats(0.02, 0.8), min_size=count, max_size=count))
    offset = draw(st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)))
    return Footprint(np.transpose(radii * np.array([np.cos(angles), np.sin(angles)])) + offset)


yaws = st.floats(-7, 7) | st.sampled_from([0.0, np.pi / 2, -np.pi, 0.5])


@given(footprints() | st.sampled_from([ROBOT, ELL, FORK, Footprint.circle(0.3)]), yaws, st.data())
def test_runs_cover_the_touched_squares(footprint, yaw, data):
    resolution = data.draw(st.sampled_from([0.03, 0.1, 0.5]))
    u, v = data.draw(st.tuples(*[st.floats(-3, 3) | st.integers(-2, 2)] * 2))
    pose, row, first, stop = touched_runs(
        footprint, resolution, np.array([[u, v]], np.float64), np.array([yaw])
    )
    assert not pose.any()
    found = [
        (r, c)
        for r, begin, end in zip(row.tolist(), first.tolist(), stop.tolist(), strict=True)
        for c in range(begin, end)
    ]
    assert len(found) == len(set(found))
    corners = corners_at(footprint, (-u * resolution, -v * resolution, yaw))
    upper = np.floor((-corners / resolution).min(axis=0)).astype(int) - 1
    lower = np.ceil((-corners / resolution).max(axis=0)).astype(int) + 1
    near = [(r, c) for r in range(upper[0], lower[0]) for c in range(upper[1], lower[1])]
    centers = [np.add(cell, 0.5) * -resolution for cell in near]
    surely, perhaps = touched_by_hand(corners, centers, resolution)
    assert {near[n] for n in surely} <= set(found) <= {near[n] for n in perhaps}


sizes = st.tuples(*[st.integers(1, 9)] * 2)


@given(st.sampled_from([ROBOT, ELL, FORK]), sizes, st.lists(yaws, max_size=3), st.data())
def test_free_poses_touch_only_free_cells(footprint, size, yaws, data):
    seed, outside = data.draw(st.integers(0, 99)), data.draw(st.booleans())
    free = np.random.default_rng(seed).random(size) > 0.03
    found = free_poses(free, footprint, 0.2, yaws, outside_is_free=outside)
    assert found.shape == (*size, len(yaws))
    for (*cell, number), is_free in np.ndenumerate(found):
        origin, yaw = np.add([cell], 0.5), np.array([yaws[number]])
        _, row, first, stop = touched_runs(footprint, 0.2, origin, yaw)
        expected = all(
            free[r, c] if 0 <= r < size[0] and 0 <= c < size[1] else outside
            for r, begin, end in zip(row, first, stop, strict=True)
            for c in range(begin, end)
        )
        assert is_free == expected


def test_free_poses_of_a_footprint_larger_than_the_map():
    whole = np.ones((3, 5), bool)
    assert not free_poses(whole, Footprint.circle(50.0), 0.1, [0.0]).any()
    assert free_poses(whole, Footprint.circle(50.0), 0.1, [0.0], outside_is_free=True).all()
    whole[0, 0] = False
    assert not free_poses(whole, Footprint.circle(50.0), 0.1, [0.0], outside_is_free=True).any()


def test_circle_is_a_polygon_around_the_circle():
    circle = Footprint.circle(0.3)
    assert len(circle.points) == 32
    assert circle.is_convex
    middles = 0.5 * (circle.points + np.roll(circle.points, 1, axis=0))
    np.testing.assert_allclose(np.hypot(*middles.T), 0.3)


def test_repeated_corners_are_omitted():
    square = Footprint([(1, 1), (1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)])
    assert square == Footprint([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    assert hash(square) == hash(Footprint(square.points))
    assert repr(square).startswith("Footprint([[1.0, 1.0], [-1.0, 1.0]")
    assert square != Footprint.rectangle(2, 1)
    assert (square.radius, square.is_convex) == (math.sqrt(2), True)
    assert not square.points.flags.writeable


@pytest.mark.parametrize(
    ("create", "expected"),
    [
        (lambda: Footprint([(0, 0), (1, 0)]), "points: expected at least 3 corners in order"),
        (lambda: Footprint([(0, 0), (1, 0), (2, 0)]), "points: expected at least 3 corners"),
        (lambda: Footprint([(0, 0), (1, 1), (1, 0), (0, 1)]), "that does not cross itself"),
        (lambda: Footprint([(0, 0), (1, np.nan), (1, 0)]), "expected finite x, y of shape"),
        (lambda: Footprint([0, 1, 2]), "expected x, y of shape"),
        (lambda: Footprint.circle(0.0), "radius: expected a positive number, got 0.0"),
        (lambda: Footprint.rectangle(1.0, np.inf), "width: expected a positive number"),
    ],
)
def test_wrong_outlines_are_refused(create, expected):
    with pytest.raises(GeometryError, match=expected):
        create()


def test_footprints_larger_than_any_map_are_refused():
    with pytest.raises(LimitError, match="footprint: expected at most 16000000 cells"):
        free_poses(np.ones((3, 3), bool), Footprint.circle(1e6), 0.1, [0.0])
