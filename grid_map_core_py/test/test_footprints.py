# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of robots, and the cells that they touch."""

import numpy as np
import pytest
from footprints import ELL, FORK, ROBOT, corners_at, footprints, touched_by_hand, yaws
from hypothesis import given, strategies as st

from grid_map_core_py import GeometryError, LimitError
from grid_map_core_py.planning import Footprint
from grid_map_core_py.planning._footprint import touched_cells


@given(footprints() | st.sampled_from([ROBOT, ELL, FORK, Footprint.circle(0.3)]), yaws, st.data())
def test_touched_cells_are_the_touched_squares(footprint, yaw, data):
    resolution = data.draw(st.sampled_from([0.03, 0.1, 0.5]))
    u, v = data.draw(st.tuples(*[st.floats(-3, 3) | st.integers(-2, 2)] * 2))
    origin = np.array([[u, v]], np.float64)
    pose, row, column = touched_cells(footprint, resolution, origin, np.array([yaw]))
    assert not pose.any()
    found = [*zip(row.tolist(), column.tolist(), strict=True)]
    assert len(found) == len(set(found))
    corners = corners_at(footprint, (-u * resolution, -v * resolution, yaw))
    upper = np.floor((-corners / resolution).min(axis=0)).astype(int) - 1
    lower = np.ceil((-corners / resolution).max(axis=0)).astype(int) + 1
    near = [(r, c) for r in range(upper[0], lower[0]) for c in range(upper[1], lower[1])]
    centers = [np.add(cell, 0.5) * -resolution for cell in near]
    surely, perhaps = touched_by_hand(corners, centers, resolution)
    assert {near[n] for n in surely} <= set(found) <= {near[n] for n in perhaps}


def test_circle_is_a_polygon_around_the_circle():
    circle = Footprint.circle(0.3)
    assert len(circle.points) == 32
    middles = 0.5 * (circle.points + np.roll(circle.points, 1, axis=0))
    np.testing.assert_allclose(np.hypot(*middles.T), 0.3)


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
        touched_cells(Footprint.circle(1e6), 0.1, np.zeros((1, 2)), np.zeros(1))
