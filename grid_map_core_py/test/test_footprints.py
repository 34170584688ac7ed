# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of robots, and the cells that they touch."""

import math

import numpy as np
import pytest
from footprints import ELL, FORK, ROBOT, corners_at, footprints, touched_by_hand, yaws
from hypothesis import given, strategies as st

from grid_map_core_py import GeometryError, LimitError
from grid_map_core_py.planning import Footprint
from grid_map_core_py.planning._footprint import free_poses, touched_runs


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
    middles = 0.5 * (circle.points + np.roll(circle.points, 1, axis=0))
    np.testing.assert_allclose(np.hypot(*middles.T), 0.3)


def test_repeated_corners_are_omitted():
    square = Footprint([(1, 1), (1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)])
    assert square == Footprint([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    assert hash(square) == hash(Footprint(square.points))
    assert repr(square).startswith("Footprint([[1.0, 1.0], [-1.0, 1.0]")
    assert square != Footprint.rectangle(2, 1)
    assert square.radius == math.sqrt(2)
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
