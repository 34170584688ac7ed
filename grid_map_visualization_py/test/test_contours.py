# SPDX-License-Identifier: BSD-3-Clause
"""Contour lines."""

import sys

import messages
import numpy as np
import pytest
from hypothesis import given, settings
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap, GridMapError
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.testing import grid_maps, moved_in_buffer
from grid_map_visualization_py import create


def drawn(grid_map: GridMap, **params: object) -> Marker:
    return messages.drawn("contours", grid_map, **{"layer": "elevation", **params})


def pieces(marker: Marker) -> np.ndarray:
    """Return (N, 2, 3) start and end of every segment of a line."""
    return messages.points_of(marker).reshape(-1, 2, 3)


def slope() -> GridMap:
    """Return a map whose height is x, on cells of 1 m centered at -3 to 3 m."""
    grid_map = GridMap((7, 5), 1.0, layers=["elevation"], frame_id="odom")
    grid_map["elevation"][:] = grid_map.geometry.axes_in_map_order()[0][:, None]
    return grid_map


def test_contour_of_a_slope_is_straight_and_exact():
    marker = drawn(slope(), levels=[0.25])
    found = pieces(marker)
    np.testing.assert_allclose(found[..., 0], 0.25, atol=1e-6)
    assert (found[..., 2] == 0.25).all()
    # Four segments between the five columns, each once.
    ends = sorted(tuple(sorted(piece)) for piece in found[..., 1].tolist())
    assert ends == [(-2, -1), (-1, 0), (0, 1), (1, 2)]
    assert (marker.type, marker.ns) == (Marker.LINE_LIST, "contours")
    assert marker.header.frame_id == "odom"
    flat = pieces(drawn(slope(), levels=[0.25], flat=True))
    np.testing.assert_array_equal(flat, found * (1, 1, 0))


@pytest.mark.parametrize(
    ("params", "expected"),
    [
        ({"interval": 2}, {-2, 0, 2}),
        ({"interval": 1.25}, {-2.5, -1.25, 0, 1.25, 2.5}),
        ({"interval": 2, "levels": [1, -1.5, 1]}, {-1.5, 1}),
        ({"levels": [17.0]}, set()),
        ({"interval": 100.0, "levels": []}, {0}),
    ],
)
def test_contours_lie_at_multiples_or_at_given_levels(params, expected):
    found = pieces(drawn(slope(), **params))
    assert set(found[..., 2].ravel()) == expected
    np.testing.assert_allclose(found[..., 0], found[..., 2], atol=1e-6)


def test_lines_end_at_holes():
    grid_map = slope()
    grid_map["elevation"][3, 2] = np.nan
    ends = pieces(drawn(grid_map, levels=[0.4]))[..., 1]
    # The line runs between rows 2 and 3; at the hole no square has four corners.
    assert ends.max() == 2
    assert ends.min() == -2
    assert not ((ends > -0.5) & (ends < 0.5)).any()


@settings(max_examples=60)
@given(grid_maps(max_side=6))
def test_contours_of_a_moved_map_are_the_same(grid_map):
    marker = drawn(grid_map, levels=[0.0, 10.0])
    found = pieces(marker)
    assert np.isfinite(found).all()
    assert len(marker.colors) == len(marker.points)
    for k, axis in enumerate(grid_map.geometry.axes_in_map_order()):
        assert (found[..., k] >= axis[-1] - 1e-9).all()
        assert (found[..., k] <= axis[0] + 1e-9).all()
    moved = moved_in_buffer(grid_map, (grid_map.size[0] - 1, grid_map.size[1] // 2))
    assert (pieces(drawn(moved, levels=[0.0, 10.0])) == found).all()


@settings(max_examples=60)
@given(grid_maps(max_side=5, allow_infinity=False))
def test_interpolated_values_on_a_contour_equal_its_level(grid_map):
    level = 0.5
    x, y = grid_map.geometry.axes_in_map_order()
    values = grid_map.unwrapped("elevation").astype(np.float64)
    for px, py, _ in pieces(drawn(grid_map, levels=[level])).reshape(-1, 3):
        row, column = (x[0] - px) / grid_map.resolution, (y[0] - py) / grid_map.resolution
        (r, fr), (c, fc) = (divmod(round(v, 9), 1) for v in (row, column))
        # A point between two cells, along an axis or (beside a hole) on a diagonal.
        assert min(fr, fc, abs(fr - fc), abs(fr + fc - 1)) < 1e-6
        near = values[int(r) : int(r) + 2, int(c) : int(c) + 2]
        assert np.nanmin(near) <= level <= np.nanmax(near)


def test_map_without_values_has_no_lines():
    assert drawn(GridMap((4, 3), 1.0, layers={"elevation": np.nan})).points == []


def test_far_too_small_interval_is_an_error():
    with pytest.raises(GridMapError, match="'interval': 1e-05 gives more than 10000 lines"):
        drawn(slope(), interval=1e-5)


def test_error_without_contourpy_names_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "contourpy", None)
    with pytest.raises(
        ConfigError, match=r"visualization 'a' .*contours needs .*'contourpy'.*install"
    ):
        create("a", {"type": "contours", "params": {"layer": "a"}})
