# SPDX-License-Identifier: BSD-3-Clause
"""Footprints, checks of poses and paths, resting poses, and layers of values under a footprint."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from grid_map_core_py import (
    ConfigError,
    GeometryError,
    GridMap,
    LayerNotFoundError,
    LimitError,
    Polygon,
)
from grid_map_core_py.planning import (
    Footprint,
    check_path,
    check_pose,
    footprint_cells,
    footprint_layer,
)
from grid_map_core_py.testing import grid_maps, moved_in_buffer

ROBOT = Footprint.rectangle(0.9, 0.5)
ELL = Footprint([(0.0, 0.0), (0.7, 0.0), (0.7, 0.2), (0.2, 0.2), (0.2, 0.6), (0.0, 0.6)])
FORK = Footprint([(-0.3, 0), (0.5, -0.3), (0.5, -0.2), (0.0, 0.0), (0.5, 0.2), (0.5, 0.3)])
MARGIN = 2e-9
"""Distance [m] within which a footprint only touches a cell, which counts or not."""
yaws = st.floats(-7, 7) | st.sampled_from([0.0, np.pi / 2, -np.pi, 0.5])
RULES = {"layer": "value", "limit": 0.5}
fractions = st.tuples(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7))


def meets_square(corners, center, half):
    """Oracle: an edge is partly in the square, or the center of the square is in the polygon."""
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


@st.composite
def footprints(draw):
    """Stars around a point: convex or not, some without the origin inside."""
    count = draw(st.integers(3, 9))
    angles = 2 * np.pi * (np.arange(count) + draw(st.floats(0, 0.9))) / count
    radii = draw(st.lists(st.floats(0.02, 0.8), min_size=count, max_size=count))
    offset = draw(st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)))
    return Footprint(np.transpose(radii * np.array([np.cos(angles), np.sin(angles)])) + offset)


def value_map(size=(40, 30), resolution=0.1, value=1.0):
    """A moved map with one layer."""
    grid_map = GridMap(np.multiply(size, resolution), resolution, (0.3, -0.2), {"value": value})
    return moved_in_buffer(grid_map, (size[0] // 3, size[1] // 2))


def on_map(grid_map, fraction, yaw):
    return (*(grid_map.position + np.multiply(fraction, grid_map.length)), yaw)


def padded(grid_map, cells):
    """The same map with unknown cells around it, stored in map order."""
    layers = {
        name: np.pad(grid_map.unwrapped(name), cells, constant_values=np.nan) for name in grid_map
    }
    length = grid_map.length + 2 * cells * grid_map.resolution
    return GridMap(length, grid_map.resolution, grid_map.position, layers)


def cell_set(indices):
    return set(map(tuple, np.asarray(indices).tolist()))


@given(grid_maps(max_side=8), footprints() | st.sampled_from([ELL, FORK]), fractions, yaws)
def test_footprint_cells_are_the_touched_squares(grid_map, footprint, fraction, yaw):
    x, y, yaw = pose = on_map(grid_map, fraction, yaw)
    found = footprint_cells(grid_map, footprint, pose)
    assert (found.shape, found.dtype) == ((len(found), 2), np.int64)
    assert len(cell_set(found)) == len(found)
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    corners = footprint.points @ turn.T + (x, y)
    surely, perhaps = (
        {
            cell
            for cell in np.ndindex(grid_map.size)
            if meets_square(corners, grid_map.get_position(cell), grid_map.resolution / 2 + margin)
        }
        for margin in (-MARGIN, MARGIN)
    )
    assert surely <= cell_set(found) <= perhaps


def test_cells_on_the_rim_of_a_footprint_do_not_count():
    grid_map = value_map()
    pose = (*grid_map.get_position((20, 20)), 0.0)
    assert len(footprint_cells(grid_map, Footprint.rectangle(0.9, 0.5), pose)) == 9 * 5
    assert len(footprint_cells(grid_map, Footprint.rectangle(0.9, 0.5), (*pose[:2], np.pi))) == 45
    assert len(footprint_cells(grid_map, Footprint.rectangle(0.92, 0.5), pose)) == 11 * 5


def test_circle_is_a_polygon_around_the_circle():
    circle = Footprint.circle(0.3)
    assert len(circle.points) == 32
    middles = 0.5 * (circle.points + np.roll(circle.points, 1, axis=0))
    np.testing.assert_allclose(np.hypot(*middles.T), 0.3)


@given(
    grid_maps(layers=("value", "height"), max_side=9),
    footprints() | st.sampled_from([ELL, FORK]),
    fractions,
    yaws,
    st.floats(-1e3, 1e3),
    st.sampled_from(["blocked", "free"]),
)
def test_pose_check_equals_the_cells_by_hand(grid_map, footprint, fraction, yaw, limit, unknown):
    pose = on_map(grid_map, fraction, yaw)
    rules = {"layer": "value", "limit": limit, "unknown": unknown}
    found = check_pose(grid_map, footprint, pose, **rules)

    def bad(values):
        low = np.isfinite(values) & (values < np.float32(limit))
        return low | ~np.isfinite(values) if unknown == "blocked" else low

    wide = padded(grid_map, math.ceil(2 / grid_map.resolution) + 8)
    under = wide["value"][tuple(footprint_cells(wide, footprint, pose).T)]
    known = under[np.isfinite(under)].astype(float)
    assert found.unknown == pytest.approx(1 - known.size / under.size)
    np.testing.assert_equal(found.worst, known.min(initial=np.inf) if known.size else np.nan)
    np.testing.assert_allclose(found.mean, known.mean() if known.size else np.nan, rtol=1e-6)
    assert found.is_free == (not bad(under).any())
    here = footprint_cells(grid_map, footprint, pose)
    blocked = here[bad(grid_map["value"][tuple(here.T)])]
    np.testing.assert_array_equal(found.blocked, blocked)
    # A path of one pose is the same.
    path = vars(check_path(grid_map, footprint, [pose], **rules))
    np.testing.assert_equal(path, {name: getattr(found, name) for name in path})


@pytest.mark.parametrize("limits", [{"limit": 0.6}, {"limit": 0.0, "mean_limit": 0.6}])
def test_values_and_means_equal_to_a_limit_are_free(limits):
    grid_map, poses = value_map(value=0.6), [(-0.6, 0, 0), (0.6, 0, 0)]
    assert check_path(grid_map, ROBOT, poses, layer="value", **limits).is_free
    grid_map["value"][grid_map.get_positions()[:, 0].reshape((40, 30), order="F") > 0.3] = 0.55
    path = check_path(grid_map, ROBOT, poses, layer="value", **limits)
    assert (path.index, bool(len(path.blocked))) == (0, "mean_limit" not in limits)
    assert not check_pose(grid_map, ROBOT, path.pose, layer="value", **limits).is_free
    before = path.pose - (0.05, 0, 0)
    assert check_pose(grid_map, ROBOT, before, layer="value", **limits).is_free


def test_poses_beyond_the_map_are_unknown():
    grid_map = value_map()
    for pose in ((100.0, 0, 0), (-1e300, 1e300, 0)):
        blocked = check_pose(grid_map, ROBOT, pose, **RULES)
        free = check_pose(grid_map, ROBOT, pose, **RULES, unknown="free")
        assert (blocked.is_free, free.is_free) == (False, True)
        assert (free.unknown, blocked.blocked.shape) == (1.0, (0, 2))
        np.testing.assert_equal((free.worst, free.mean), (np.nan, np.nan))


def dense(poses, steps):
    """The poses of a path with many more between them, on the shorter way."""
    result = []
    for begin, end in pairwise(poses):
        move = np.subtract(end, begin)
        move[2] = math.atan2(math.sin(move[2]), math.cos(move[2]))
        result += [begin + move * share for share in np.linspace(0, 1, steps, endpoint=False)]
    return [*result, np.array(poses[-1])]


paths = st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1), yaws), min_size=1, max_size=3)


@given(paths)
def test_path_covers_what_comes_a_quarter_of_a_cell_inside(poses):
    grid_map = value_map(value=0.0)
    grid_map.move((0.0, 0.0))
    grid_map["value"] = 0.0
    turns = np.diff(np.array(poses)[:, 2])
    assume((np.abs(np.cos(turns / 2)) > 1e-6).all())  # half a turn has two shorter ways
    found = cell_set(check_path(grid_map, ROBOT, poses, **RULES).blocked)
    samples = dense(poses, 70)
    inner = Footprint.rectangle(0.9 - 0.05, 0.5 - 0.05)
    inside = set().union(*(cell_set(footprint_cells(grid_map, inner, p)) for p in samples))
    assert inside <= found
    # Corners move by up to 0.08 m between these poses, so cells may be touched in between.
    outer = Footprint.rectangle(0.9 + 0.08, 0.5 + 0.08)
    around = set().union(*(cell_set(footprint_cells(grid_map, outer, p)) for p in samples))
    assert found <= around
    for pose in poses:
        assert cell_set(footprint_cells(grid_map, ROBOT, pose)) <= found


@given(paths, st.integers(0, 999), st.sampled_from(["blocked", "free"]))
def test_first_blocked_pose_of_a_path(poses, seed, unknown):
    random = np.random.default_rng(seed)
    grid_map = value_map()
    values = np.where(random.random(grid_map.size) < 0.003, 0.0, 1.0)
    grid_map["value"] = np.where(random.random(grid_map.size) < 0.003, np.nan, values)
    rules = {**RULES, "unknown": unknown}
    found = check_path(grid_map, ROBOT, poses, **rules)
    if found.is_free:
        assert (found.index, found.pose) == (None, None)
        assert all(check_pose(grid_map, ROBOT, pose, **rules).is_free for pose in dense(poses, 9))
        return
    assert not check_pose(grid_map, ROBOT, found.pose, **rules).is_free
    assert all(check_pose(grid_map, ROBOT, p, **rules).is_free for p in poses[: found.index])
    path = check_path(grid_map, ROBOT, poses[: found.index + 1], **rules)
    is_given = np.array_equal(found.pose, poses[found.index])
    assert path.index == (found.index if is_given else None)


def test_each_cell_of_a_path_counts_once():
    grid_map = value_map((31, 21))
    random = np.random.default_rng(0)
    grid_map["value"] = np.where(random.random((31, 21)) < 0.2, np.nan, random.random((31, 21)))
    # To and fro, partly beyond the map.
    poses = [(0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, 0.0, 0.0), (-3.0, 0.0, 0.0)]
    found = check_path(grid_map, ROBOT, poses, **RULES, unknown="free")
    whole = padded(grid_map, 60)
    swept = Footprint([(-3.45, -0.25), (3.45, -0.25), (3.45, 0.25), (-3.45, 0.25)])
    cells = footprint_cells(whole, swept, (0.0, 0.0, 0.0))
    values = whole["value"][tuple(cells.T)]
    assert found.unknown == pytest.approx(np.isnan(values).mean())
    assert found.mean == pytest.approx(np.nanmean(values))


def hill(height, size=(40, 31)):
    """A moved map whose heights are `height(x, y)`."""
    grid_map = value_map(size)
    x, y = (axis.reshape(grid_map.size, order="F") for axis in grid_map.get_positions().T)
    grid_map["elevation"] = np.vectorize(height)(x, y)
    return grid_map


def rest(grid_map, pose, footprint=ROBOT, **rules):
    return check_pose(grid_map, footprint, pose, **RULES, surface="elevation", **rules)


@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), fractions, yaws)
def test_sole_rests_on_a_plane(slope_x, slope_y, position, yaw):
    grid_map = hill(lambda x, y: 100 + slope_x * x + slope_y * y)
    x, y = position
    found = rest(grid_map, (x, y, yaw))
    assert found.height == pytest.approx(100 + slope_x * x + slope_y * y, abs=1e-4)
    np.testing.assert_allclose(slopes(found, yaw), (slope_x, slope_y), atol=3e-4)


def slopes(found, yaw):
    """Return the slopes along x and y of the plane on which Rz(yaw) Ry(pitch) Rx(roll) stands."""
    ahead, left = -math.tan(found.pitch), math.tan(found.roll) / math.cos(found.pitch)
    return ahead * np.array([math.cos(yaw), math.sin(yaw)]) + left * np.array(
        [-math.sin(yaw), math.cos(yaw)]
    )


def plane_by_hand(grid_map, pose, footprint=ROBOT):
    """Oracle: the lowest plane at the mean of the cells that is nowhere below a cell."""
    from scipy.optimize import linprog

    cells = tuple(footprint_cells(grid_map, footprint, pose).T)
    heights = grid_map["elevation"][cells].astype(np.float64)
    centers = grid_map.get_positions(cells)[np.isfinite(heights)] - pose[:2]
    heights = heights[np.isfinite(heights)]
    rows = np.column_stack([centers, np.ones(len(centers))])
    found = linprog(rows.mean(axis=0), A_ub=-rows, b_ub=-heights, bounds=(None, None))
    return rows.mean(axis=0) @ found.x, rows, heights


@given(st.integers(0, 999), fractions, yaws, st.sampled_from([ROBOT, ELL, Footprint.circle(0.4)]))
def test_sole_rests_on_the_lowest_plane_above_rough_ground(seed, position, yaw, footprint):
    random = np.random.default_rng(seed)
    grid_map = hill(lambda x, _: 0.2 * random.random() + 5 + 0.3 * x)
    grid_map["elevation"][random.random(grid_map.size) < 0.3] = np.nan
    pose = (*position, yaw)
    found = rest(grid_map, pose, footprint, unknown="free", body_height=0.3)
    lowest, rows, heights = plane_by_hand(grid_map, pose, footprint)
    # On a ridge, two planes are equally low.
    plane = np.array([*slopes(found, yaw), found.height])
    assert rows.mean(axis=0) @ plane == pytest.approx(lowest, abs=1e-5)
    assert (rows @ plane >= heights - 1e-5).all()
    assert found.clearance == pytest.approx(found.height + 0.3 - heights.max(), abs=1e-6)


def test_kerb_tilts_the_sole():
    """The front is on a kerb of 0.15 m, from the cell at 0.25 m on."""
    grid_map = hill(lambda x, _: 0.15 * (x > 0.2))
    poses = [(-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    # The slope is 0.15 / 0.7, from the last row of cells at -0.45 m; the clearance is 0.196 m.
    for limit, is_free in (
        ({"max_pitch": 0.2}, False),
        ({"max_pitch": 0.3, "max_roll": 0.01, "min_clearance": 0.18}, True),
        ({"min_clearance": 0.21}, False),
    ):
        assert rest(grid_map, poses[1], body_height=0.25, **limit).is_free == is_free
    path = check_path(grid_map, ROBOT, poses, **RULES, surface="elevation", max_pitch=0.2)
    assert path.index == 0
    assert not rest(grid_map, path.pose, max_pitch=0.2).is_free


def test_sole_on_few_known_cells():
    grid_map = hill(lambda x, _: x)
    x, y = grid_map.get_position(grid_map.get_index((0.0, 0.0)))
    grid_map["elevation"] = np.nan
    pose = (x, y, 0.0)
    nothing = rest(grid_map, pose, unknown="free", max_roll=0.1)
    assert nothing.is_free
    assert nothing.unknown == 1.0
    assert math.isnan(nothing.height)
    grid_map["elevation"][grid_map.get_index((x + 0.2, y + 0.1))] = 7.0
    assert not rest(grid_map, pose).is_free
    level = rest(grid_map, pose, unknown="free")
    np.testing.assert_allclose((level.height, level.roll, level.pitch), (7, 0, 0), atol=1e-9)
    # Two cells on a diagonal line: level across the line.
    grid_map["elevation"][grid_map.get_index((x - 0.2, y - 0.1))] = 6.5
    tilted = rest(grid_map, pose, unknown="free")
    slope = 0.5 / 0.5 * np.array([2, 1]) / math.hypot(2, 1) / math.hypot(0.4, 0.2) * 0.5
    assert tilted.height == pytest.approx(6.75)
    assert tilted.pitch == pytest.approx(-math.atan(slope[0]))


@pytest.mark.parametrize(
    "rules",
    [{"limit": 0.5}, {"limit": 0, "mean_limit": 0.99}, {"surface": "elevation", "max_pitch": 0.1}],
)
def test_long_paths_are_checked_to_their_end(rules):
    grid_map = hill(lambda x, _: 0.2 * (x > 1.2))
    grid_map["value"] = grid_map["elevation"] == 0 if "surface" not in rules else 1.0
    poses = [*[(-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)] * 15, (1.0, 0.0, 0.0)]
    found = check_path(grid_map, ROBOT, poses, **{**RULES, **rules})
    assert found.index == 29
    assert 0.7 < found.pose[0] < 0.86


@given(
    grid_maps(max_side=7),
    st.sampled_from([Footprint.rectangle(0.5, 0.3), ELL, FORK, Footprint.circle(0.2)]),
    st.integers(1, 5),
    st.sampled_from(["min", "mean", "max"]),
)
def test_footprint_layer_equals_pose_checks(grid_map, footprint, yaws, statistic):
    found = footprint_layer(grid_map, footprint, "elevation", yaws, statistic)
    assert found.shape == (*grid_map.size, yaws)
    assert found.dtype == np.float32
    wide = padded(grid_map, math.ceil(1 / grid_map.resolution) + 1)
    compute = {"min": np.min, "mean": np.mean, "max": np.max}[statistic]
    for (*cell, number), value in np.ndenumerate(found):
        pose = (*grid_map.get_position(cell), 2 * np.pi * number / yaws)
        under = wide["elevation"][tuple(footprint_cells(wide, footprint, pose).T)].astype(float)
        expected = compute(under) if np.isfinite(under).all() else np.nan
        np.testing.assert_allclose(value, expected, rtol=1e-5, atol=1e-5)


def test_footprint_layer_of_a_map_smaller_than_the_footprint():
    grid_map = GridMap((0.3, 0.5), 0.1, layers={"value": 1.0})
    narrow = GridMap((2.1, 0.5), 0.1, layers={"value": 1.0})
    for statistic in ("min", "mean", "max"):
        assert np.isnan(footprint_layer(grid_map, ROBOT, "value", 4, statistic)).all()
        found = footprint_layer(narrow, ROBOT, "value", 12, statistic)
        assert np.isfinite(found).sum(axis=(0, 1)).tolist() == [13, *5 * [0], 13, *5 * [0]]


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"layer": "hight"}, LayerNotFoundError, "no layer 'hight'"),
        ({"surface": "hight"}, LayerNotFoundError, "no layer 'hight'"),
        ({"limit": np.nan}, ConfigError, "'limit': expected a number, got nan"),
        ({"mean_limit": "high"}, GeometryError, "mean_limit: expected a number"),
        ({"unknown": "open"}, ConfigError, "'unknown': expected 'blocked' or 'free'"),
        ({"max_roll": 0.1}, ConfigError, "'surface': expected a layer .*, for max_roll"),
        ({"surface": "value", "min_clearance": 0.1}, ConfigError, "'body_height': expected"),
    ],
)
def test_wrong_rules_are_refused(change, error, text):
    for call, pose in (check_pose, (0, 0, 0)), (check_path, [(0, 0, 0)]):
        with pytest.raises(error, match=text):
            call(value_map(), ROBOT, pose, **{**RULES, **change})


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda _: Footprint([(0, 0), (1, 0)]), "points: expected at least 3 corners in order"),
        (lambda _: Footprint([(0, 0), (1, 1), (1, 0), (0, 1)]), "that does not cross itself"),
        (lambda _: Footprint([(0, 0), (1, np.nan), (1, 0)]), "expected finite x, y of shape"),
        (lambda _: Footprint.rectangle(1.0, 1e-9), "points: expected .* at least 1e-06 m wide"),
        (lambda _: Footprint.circle(0.0), r"radius: expected a length > 1e-06 \[m\], got 0.0"),
        (lambda _: Footprint.circle(1e-6), r"radius: expected a length > 1e-06 \[m\], got 1e-06"),
        (
            lambda m: check_pose(m, ROBOT, (0, 0), **RULES),
            r"pose: .* of shape \(3,\), got \(0, 0\)",
        ),
        (lambda m: check_pose(m, ROBOT, [(0, 0, 0)], **RULES), r"pose: .* of shape \(3,\)"),
        (lambda m: footprint_cells(m, ROBOT, (0, 0, np.nan)), "pose: expected finite x, y, yaw"),
        (lambda m: check_path(m, ROBOT, [], **RULES), r"poses: .* of shape \(N, 3\), N > 0"),
        (lambda m: check_path(m, ROBOT, [(0, 0, 0), (1e9, 0, 0)], **RULES), "poses: expected at m"),
        (lambda m: footprint_cells(m, Footprint.circle(1e6), (0, 0, 0)), "footprint: expected at"),
        (lambda m: footprint_layer(m, ROBOT, "value", 0), "'yaws': expected a number of direct"),
        (lambda m: footprint_layer(m, ROBOT, "value", 1, "median"), "'statistic': expected 'min'"),
    ],
)
def test_wrong_arguments_are_refused(call, text):
    with pytest.raises((ConfigError, GeometryError, LimitError), match=text):
        call(value_map())


@pytest.mark.parametrize("size", [(5e-6, 5e-6), (1.0, 2.1e-6), (2.1e-6, 1.0)])
def test_smallest_footprints_touch_cells_on_borders_and_corners(size):
    grid_map = GridMap((2.0, 3.0), 0.5, layers={"value": 1.0})
    for pose in ((0.0, 0.0, 0.0), (0.5, 0.25, 0.0), (0.25, 0.5, np.pi / 2)):
        assert len(footprint_cells(grid_map, Footprint.rectangle(*size), pose)) > 0


def test_huge_value_changes_only_means_under_it():
    grid_map = value_map(value=0.25)
    grid_map["value"][0, 0] = 1e30
    found = footprint_layer(grid_map, ROBOT, "value", 3, "mean")
    known = np.isfinite(found)
    assert ((found[known] == 0.25) | (found[known] > 1e27)).all()
    assert (found[known] == 0.25).sum() > 500
