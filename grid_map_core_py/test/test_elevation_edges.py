# SPDX-License-Identifier: BSD-3-Clause
"""`ElevationMapper` at its edges: order, borders, extreme numbers, changes, wrong arguments."""

import numpy as np
import pytest

from grid_map_core_py import (
    ConfigError,
    GeometryError,
    GridGeometry,
    GridMap,
    GridMapError,
    LayerNotFoundError,
    LimitError,
)
from grid_map_core_py._loops import Loop
from grid_map_core_py.elevation import (
    ConstantModel,
    ElevationMapper,
    LaserModel,
    PerfectModel,
    StereoModel,
    StructuredLightModel,
)
from grid_map_core_py.limits import changed_limits
from grid_map_core_py.testing import assert_maps_equal

SECOND = 10**9
GEOMETRY = GridGeometry.from_size((12, 9), 0.2)
UP = np.eye(4)
UP[2, 3] = 1.0


both_ways = pytest.mark.usefixtures("way")


def mapper_of(geometry=GEOMETRY, **given):
    return ElevationMapper(geometry, **given)


def at(x, y, *heights):
    """Points above one place, for a sensor 1 m above the origin."""
    return [(x, y, z - 1.0) for z in heights]


def height(mapper, x, y, layer="elevation"):
    return float(mapper.grid_map[layer][mapper.grid_map.get_index((x, y))])


def cloud(count=600, seed=1):
    random = np.random.default_rng(seed)
    points = random.uniform((-1.3, -1.0, -1.2), (1.3, 1.0, 0.5), (count, 3)).astype(np.float32)
    # Equal points, and equal heights of unequal variance.
    points[count // 2 :] = points[: count - count // 2]
    points[-40:, 2] = -0.5
    return points


FUSIONS = {
    "intensity": "average",
    "newest": "latest",
    "slow": "exponential",
    "top": "max",
    "class_.*": "class_bayesian",
}


def values_of(count, seed=2):
    random = np.random.default_rng(seed)
    names = ["intensity", "newest", "slow", "top", "class_grass", "class_stone"]
    values = {name: random.uniform(0, 1, count) for name in names}
    values["rgb"] = random.integers(0, 1 << 24, count, np.uint32).view(np.float32)
    values["intensity"][:9] = np.nan
    return values


@both_ways
def test_order_of_points_changes_no_bit():
    one, other = (mapper_of(value_fusions=FUSIONS, scanning_duration=0.0) for _ in range(2))
    random = np.random.default_rng(3)
    for step in range(4):
        points, values = cloud(seed=step), values_of(600, seed=step)
        order = random.permutation(len(points))
        covariance = 1e-4 * np.eye(6)
        given = {"timestamp": step * SECOND, "pose_covariance": covariance}
        first = one.update(points, UP, values=values, **given)
        shuffled = {name: column[order] for name, column in values.items()}
        second = other.update(points[order], UP, values=shuffled, **given)
        assert first.points_used == second.points_used
        for name, layer in one.grid_map.items():
            found = other.grid_map[name]
            np.testing.assert_array_equal(layer.view(np.uint32), found.view(np.uint32), name)


@pytest.mark.needs("numba")
def test_both_ways_give_the_same_maps(monkeypatch):
    maps = []
    for is_compiled in (True, False):
        if not is_compiled:
            monkeypatch.setattr(Loop, "compiled", lambda _: None)
        mapper = mapper_of(scanning_duration=0.0, conflict_points=1)
        for step in range(6):
            points = cloud(20_000, seed=step) * np.float32(1.0 - 0.1 * step)
            mapper.update(points, UP, timestamp=step * SECOND)
        behind, _ = mapped_behind_glass()
        maps += [mapper.grid_map, behind]
    for one, other in zip(maps[:2], maps[2:], strict=True):
        assert_maps_equal(one, other)


def mapped_behind_glass():
    """Map two bands of ground; reflections then pass below the first one, which is seen again."""
    mapper = mapper_of(GridGeometry((8.0, 8.0), 0.1))
    x, y = (
        part.ravel() for part in np.meshgrid(np.linspace(1.8, 2.15, 8), np.linspace(-1, 1, 200))
    )
    near = np.column_stack((x, y, np.full(len(x), -1.0)))
    far = near + (1.1, 0.0, 0.0)
    mapper.update(np.vstack((near, far)), UP, timestamp=0)
    beams = near * (3.6 / 1.8) * (1.0, 1.0, 1.2)
    report = mapper.update(np.vstack((near, beams)), UP, timestamp=2 * SECOND)
    return mapper.grid_map, report.cells_cleared


@both_ways
def test_reflections_below_confirmed_ground_clear_nothing():
    assert mapped_behind_glass()[1] == 0


@both_ways
def test_moved_map_equals_map_that_began_there():
    shift = (0.6, -1.0)
    mapper, fresh = mapper_of(), mapper_of(GEOMETRY.shifted(GEOMETRY.index_shift(shift)))
    mapper.update(cloud(), UP, timestamp=0)
    mapper.clear()
    for step in range(3):
        points = cloud(seed=step)
        mapper.update(points, UP, timestamp=step * SECOND, position=shift)
        fresh.update(points, UP, timestamp=step * SECOND)
    assert_maps_equal(mapper.grid_map, fresh.grid_map)


@pytest.mark.parametrize("is_by_caller", [False, True])
def test_move_equals_the_move_of_an_update(is_by_caller):
    moved, updated = mapper_of(), mapper_of()
    for mapper in (moved, updated):
        mapper.update(cloud(), UP, timestamp=0, values=values_of(600))
    (moved.grid_map if is_by_caller else moved).move((0.4, 0.2))
    scan = {"points": cloud(seed=5), "transform": UP, "timestamp": 1, "values": values_of(600)}
    moved.update(**scan)
    updated.update(**scan, position=(0.4, 0.2))
    assert_maps_equal(moved.grid_map, updated.grid_map)
    with pytest.raises(GeometryError):
        moved.move((np.nan, 0.0))


@both_ways
@pytest.mark.parametrize("points", [np.empty((0, 3)), np.full((4, 3), np.nan)])
def test_scan_without_points_keeps_the_map(points):
    mapper = mapper_of()
    mapper.update(cloud(), UP, timestamp=0)
    before = mapper.grid_map.copy()
    report = mapper.update(points, UP, timestamp=SECOND)
    before.timestamp = SECOND
    assert_maps_equal(mapper.grid_map, before)
    assert (report.points_used, report.points_dropped) == (0, len(points))


@both_ways
def test_map_of_one_cell():
    mapper = mapper_of(GridGeometry.from_size((1, 1), 1.0), min_variance=1e-9)
    mapper.update([(0.1, 0.2, -1.0), (3.0, 0.1, -0.9), (-0.3, 0.1, -1.01)], UP, timestamp=0)
    assert height(mapper, 0, 0) == pytest.approx(-0.005, abs=5e-3)
    mapper.update(at(0.1, 0.1, 0.5, 0.51), UP, timestamp=SECOND)
    assert height(mapper, 0, 0) == pytest.approx(0.505, abs=1e-3)


def test_points_on_borders_belong_to_the_cells_of_the_geometry():
    rows, columns = GEOMETRY.size
    x, y = 0.1 * np.arange(-rows, rows + 1), 0.1 * np.arange(-columns, columns + 1)
    grid = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    points = np.column_stack((grid, np.full(len(grid), -1.0)))
    mapper = mapper_of()
    report = mapper.update(points, UP, timestamp=0)
    assert report.points_used == GEOMETRY.is_inside(grid).sum()
    assert np.isfinite(mapper.grid_map["elevation"]).all()


def ring(distance, drop, count=720):
    """Points around the sensor at a distance, lower than the sensor by `drop`."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    x, y = distance * np.cos(angle), distance * np.sin(angle)
    return np.column_stack((x, y, np.full(count, -drop)))


@pytest.mark.parametrize("scale", [0.0, 1e-30, 1e6, 1e100, 1e300])
def test_extreme_covariances(scale):
    mapper = mapper_of(max_variance=0)
    singular = np.zeros((6, 6))
    singular[2, 2] = singular[3, 3] = singular[2, 3] = singular[3, 2] = 1.0
    for step in range(3):
        pose = UP.copy()
        pose[0, 3] = 0.1 * step
        mapper.update(
            cloud(), pose, timestamp=step * SECOND, pose_covariance=scale * (step + 1) * singular
        )
    known = np.isfinite(mapper.grid_map["elevation"])
    assert (mapper.grid_map["variance"][known] >= np.float32(9e-6)).all()
    assert known.any() == (scale < 1e30)


@pytest.mark.parametrize("jump", [-57.0, 11.0])
def test_jump_of_the_time_starts_the_clock_anew(jump):
    mapper = mapper_of(GridGeometry((6.0, 6.0), 0.1))
    rings = np.vstack((ring(1.0, 0.2), ring(2.5, 1.0)))
    mapper.update(rings, UP, timestamp=100 * SECOND)
    mapper.update(rings, UP, timestamp=107 * SECOND)
    assert np.nanmax(mapper.grid_map["time"]) == 7.0
    after = (107 + round(jump)) * SECOND
    with pytest.warns(RuntimeWarning, match="timestamp: .*max_time_jump, 10 s, of 107000000000 ns"):
        report = mapper.update(ring(2.5, 1.0), UP, timestamp=after)
    assert report.cells_cleared == 0
    assert np.nanmax(mapper.grid_map["time"]) == 0.0
    report = mapper.update(ring(2.5, 1.0), UP, timestamp=after + SECOND)
    assert report.cells_cleared > 50
    assert np.nanmax(mapper.grid_map["time"]) == 1.0


def test_bag_that_loops_within_seconds_still_clears():
    mapper = mapper_of(GridGeometry((6.0, 6.0), 0.1))
    mapper.update(np.vstack((ring(1.0, 0.2), ring(2.5, 1.0))), UP, timestamp=5 * SECOND)
    stamps = [step % 50 * SECOND // 10 for step in range(150)]
    with pytest.warns(RuntimeWarning, match="the map's clock restarts"):
        reports = [mapper.update(ring(2.5, 1.0), UP, timestamp=stamp) for stamp in stamps]
    assert sum(report.cells_cleared for report in reports) > 50


def test_sensor_that_lags_does_not_start_the_clock_anew():
    mapper = mapper_of()
    for step in range(60):
        stamp = step * SECOND // 10
        mapper.update(at(0.3, 0.3, 0.0), UP, timestamp=100 * SECOND + stamp)
        mapper.update(at(0.5, 0.3, 0.0), UP, timestamp=98 * SECOND + stamp)
    assert height(mapper, 0.5, 0.3, "time") == pytest.approx(5.9)
    assert mapper.grid_map.timestamp == 105_900_000_000


def test_scan_of_time_zero_is_dropped_with_the_reason():
    mapper = mapper_of()
    mapper.update(at(0.3, 0.3, 0.0), UP, timestamp=100 * SECOND)
    before = mapper.grid_map.copy()
    with pytest.warns(RuntimeWarning, match="timestamp: expected the time of the scan, got 0"):
        report = mapper.update(at(0.3, 0.3, 1.0, 1.0), UP, timestamp=0)
    assert (report.points_used, dict(report.reasons)) == (0, {"timestamp 0": 2})
    assert_maps_equal(mapper.grid_map, before)


def test_clock_is_exact_after_a_year():
    mapper = mapper_of(GridGeometry((6.0, 6.0), 0.1), max_time_jump=np.inf)
    rings, year = np.vstack((ring(1.0, 0.2), ring(2.5, 1.0))), 365 * 86_400 * SECOND
    mapper.update(rings, UP, timestamp=10**18)
    mapper.update(rings, UP, timestamp=10**18 + year)
    for milliseconds, is_cleared in ((999, False), (1000, True)):
        stamp = 10**18 + year + milliseconds * 10**6
        report = mapper.update(ring(2.5, 1.0), UP, timestamp=stamp)
        assert (report.cells_cleared > 50) == is_cleared
    assert np.nanmax(mapper.grid_map["time"]) == pytest.approx(365 * 86_400 + 1)


BAD = {
    "points": ({"points": [[1.0, 2.0]]}, "points"),
    "text": ({"points": "abc"}, "points"),
    "points in columns": ({"points": cloud().T}, r"points: .* \(N, 3\), got \(3, 600\)\. Transp"),
    "small transform": ({"transform": np.eye(3)}, "transform: .* the rotation and the position$"),
    "scaling transform": ({"transform": 2 * np.eye(4)}, "transform"),
    "NaN in the transform": ({"transform": np.full((4, 4), np.nan)}, "transform"),
    "float time": ({"timestamp": 1.5}, "timestamp"),
    "small covariance": ({"pose_covariance": np.eye(3)}, "pose_covariance"),
    "NaN in the covariance": ({"pose_covariance": np.full((6, 6), np.nan)}, "pose_covariance"),
    "negative covariance": ({"pose_covariance": -np.eye(6)}, "pose_covariance"),
    "skew covariance": ({"pose_covariance": np.triu(np.ones((6, 6)))}, "pose_covariance"),
    "position": ({"position": (np.nan, 0.0)}, "position"),
    "short values": ({"values": {"intensity": [1.0]}}, "values 'intensity'"),
    "values of an own layer": ({"values": {"variance": np.ones(600)}}, "values"),
    "values without a name": ({"values": {"": np.ones(600)}}, "values"),
    "values without names": ({"values": [1.0]}, "parameter 'values'"),
    "sensor": ({"sensor": "laser"}, "sensor"),
    "class of a sensor": ({"sensor": LaserModel}, r"sensor: .* class\. Pass LaserModel\(\), not"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_arguments_leave_the_map_unchanged(case):
    mapper = mapper_of()
    mapper.update(cloud(), UP, timestamp=0, values={"intensity": np.ones(600)})
    before = mapper.grid_map.copy()
    wrong, name = BAD[case]
    given = {"points": cloud(seed=4), "transform": UP, "timestamp": SECOND, "position": (0.4, 0)}
    with pytest.raises(GridMapError, match=f"^{name}"):
        mapper.update(**{**given, **wrong})
    assert_maps_equal(mapper.grid_map, before)


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: mapper_of(min_variance=0.0), "min_variance"),
        (lambda: mapper_of(max_variance=1e-9), "max_variance"),
        (lambda: mapper_of(conflict_points=0), "conflict_points"),
        (lambda: mapper_of(scanning_duration=-1.0), "scanning_duration"),
        (lambda: mapper_of(drift_compensation_alpha=1.5), "drift_compensation_alpha"),
        (lambda: mapper_of(min_range=3.0, max_range=2.0), "min_range"),
        (lambda: mapper_of(max_drift=np.nan), "max_drift"),
        (lambda: mapper_of(minimum=1), "minimum"),
        (lambda: mapper_of().fused_map(), "horizontal_variances"),
        (lambda: mapper_of(value_fusions={"a": "sum"}), "value_fusions"),
        (lambda: mapper_of(value_fusions={"(": "max"}), "value_fusions"),
        (lambda: LaserModel(min_radius=-1), "min_radius"),
        (lambda: StereoModel(baseline=0), "baseline"),
        (lambda: StructuredLightModel(cutoff_min_depth=9), "cutoff_min_depth"),
    ],
)
def test_bad_parameters_are_named(make, name):
    with pytest.raises(ConfigError, match=name):
        make()


def test_large_maps_are_refused_before_memory():
    with pytest.raises(LimitError, match="geometry"):
        mapper_of(GridGeometry((1e5, 1e5), 0.1))
    mapper = mapper_of()
    with changed_limits(max_bytes=4000), pytest.raises(LimitError, match="values"):
        mapper.update(cloud(), UP, timestamp=0, values=values_of(600))


def test_limits_of_range_and_height_drop_points():
    given = {"min_range": 0.5, "max_range": 1.3, "ignore_points_above": -0.2}
    mapper = mapper_of(**given, ignore_points_below=-0.9)
    points = [(0, 0, -0.4), (0, 0, -0.8), (1.1, 0, -0.8), (0.6, 0, -0.1), (0, 0, -0.95)]
    report = mapper.update(points, UP, timestamp=0)
    assert (report.points_used, report.points_dropped) == (1, 4)


def test_values_of_each_fusion():
    mapper = mapper_of(sensor=PerfectModel(), value_fusions=FUSIONS)
    names = ["intensity", "newest", "slow", "top"]
    for step, pair in enumerate(((1.0, 3.0), (8.0, 8.0))):
        values = dict.fromkeys(names, pair)
        values |= {"class_grass": (1.0, 0.5), "class_stone": (0.0, 0.5)}
        values["rgb"] = np.array([0x102030, 0x304050 + step], np.uint32)
        points = at(0.3, 0.3, 0.0, 0.0)
        mapper.update(points, UP, timestamp=step * SECOND, values=values)
    found = {name: height(mapper, 0.3, 0.3, name) for name in names}
    expected = {"intensity": 5.0, "newest": 8.0, "slow": 0.7 * 8 + 0.3 * 2, "top": 8.0}
    assert found == pytest.approx(expected)
    # One count for each class at first, then 3 and 1.
    assert height(mapper, 0.3, 0.3, "class_grass") == pytest.approx(4 / 6)
    assert height(mapper, 0.3, 0.3, "class_stone") == pytest.approx(2 / 6)
    color = np.float32(height(mapper, 0.3, 0.3, "rgb")).view(np.uint32)
    assert color == 0x203041


def test_average_weighs_values_by_inverse_variances():
    mapper = mapper_of(sensor=ConstantModel(sensor_noise_factor=1e-3))
    scans = [((0.0, 0.02), (1.0, 4.0)), ((0.01,), (9.0,))]
    for step, (heights, values) in enumerate(scans):
        points = at(0.3, 0.3, *heights)
        mapper.update(points, UP, timestamp=step * SECOND, values={"intensity": values})
    weights = [1.0 / (2 * 0.3**2 + (1.0 - z) ** 2) for z in (0.0, 0.02, 0.01)]
    expected = np.average([1.0, 4.0, 9.0], weights=weights)
    assert height(mapper, 0.3, 0.3, "intensity") == pytest.approx(expected, rel=1e-6)
    assert abs(expected - np.mean([1.0, 4.0, 9.0])) > 1e-3


def test_new_height_forgets_values():
    mapper = mapper_of()
    for step, (z, value) in enumerate(((0.0, 1.0), (0.5, 7.0))):
        values = {"intensity": np.full(2, value)}
        mapper.update(at(0.3, 0.3, z, z), UP, timestamp=step * SECOND, values=values)
    assert height(mapper, 0.3, 0.3, "intensity") == 7.0


def test_configured_mapper_equals_one_made_so():
    parameters = {"mahalanobis_distance_threshold": 9.0, "exponential_alpha": 0.2}
    changed, made = mapper_of(), mapper_of(**parameters)
    changed.update(at(0.3, 0.3, 0.0), UP, timestamp=0)
    made.update(at(0.3, 0.3, 0.0), UP, timestamp=0)
    changed.configure(**parameters)
    assert changed.parameters == made.parameters
    changed.update(at(0.3, 0.3, 0.1), UP, timestamp=1)
    made.update(at(0.3, 0.3, 0.1), UP, timestamp=1)
    assert_maps_equal(changed.grid_map, made.grid_map)


@pytest.mark.parametrize(
    "wrong", [{"max_variance": 1e-9}, {"threshold": 1.0}, {"horizontal_variances": True}]
)
def test_wrong_change_keeps_all_parameters(wrong):
    mapper = mapper_of()
    before = mapper.parameters
    with pytest.raises(ConfigError):
        mapper.configure(**wrong)
    assert mapper.parameters == before


def test_clear_makes_all_cells_unknown():
    mapper = mapper_of()
    mapper.update(cloud(), UP, timestamp=0, values=values_of(600))
    earlier = mapper.grid_map
    mapper.clear()
    assert all(np.isnan(layer).all() for layer in mapper.grid_map.values())
    assert np.isfinite(earlier["elevation"]).any()


def test_masked_replace_sets_cells_of_the_mask():
    mapper = mapper_of()
    mapper.update(at(0.3, 0.3, 0.0) + at(-0.3, 0.3, 0.0), UP, timestamp=3 * SECOND)
    patch = GridMap((0.8, 0.8), 0.2, (0.4, 0.4), {"elevation": 2.0, "mask": 1.0, "other": 1.0})
    patch.move((0.6, 0.6))
    patch["elevation"][...] = 2.0
    mapper.masked_replace(patch)
    assert height(mapper, -0.3, 0.3) == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(height(mapper, 0.9, 0.9))  # The mask is NaN where the patch has moved.
    assert height(mapper, 0.5, 0.5) == 2.0
    assert height(mapper, 0.5, 0.5, "variance") == pytest.approx(9e-6)
    assert height(mapper, 0.5, 0.5, "upper_bound") == pytest.approx(2.0 + 2.486 * 3e-3)
    assert "other" not in mapper.grid_map


def test_masked_replace_refuses_other_maps():
    mapper = mapper_of()
    with pytest.raises(LayerNotFoundError):
        mapper.masked_replace(GridMap((1, 1), 0.1, layers={"other": 1.0}))
    with pytest.raises(GridMapError, match="frame"):
        mapper.masked_replace(GridMap((1, 1), 0.1, layers={"elevation": 1.0}, frame_id="map"))
    with pytest.raises(GridMapError, match="grid_map"):
        mapper.masked_replace("map")


def test_fused_map_spreads_steps_by_the_horizontal_uncertainty():
    mapper = mapper_of(GridGeometry.from_size((9, 5), 0.2), horizontal_variances=True)
    x, y = np.meshgrid(0.2 * np.arange(-4, 5), 0.2 * np.arange(-2, 3))
    points = np.column_stack((x.ravel(), y.ravel(), np.where(x.ravel() > 0.1, -0.5, -1.0)))
    covariance = np.diag([0.04, 0.04, 0.0, 0.0, 0.0, 0.0])
    points = np.repeat(points, 100, axis=0)  # One point does not tell the height of a sloping cell.
    mapper.update(points, UP, timestamp=0, pose_covariance=covariance)
    fused = mapper.fused_map()
    np.testing.assert_allclose(mapper.grid_map["horizontal_variance"], 0.04, rtol=0.02)
    # One standard deviation is one cell; the step is half a cell away from the cell at 0.
    assert height(mapper, 0.0, 0.0) == pytest.approx(0.0, abs=1e-6)
    index = fused.get_index((0.0, 0.0))
    assert fused["elevation"][index] == pytest.approx(0.5 * 0.3085, abs=2e-3)
    assert fused["variance"][index] == pytest.approx(0.25 * 0.3085 * 0.6915, abs=2e-3)
    for name, level in (("upper_bound", 0.5), ("lower_bound", 0.0)):
        assert fused[name][index] == pytest.approx(level, abs=0.05)


def test_fused_map_equals_map_without_horizontal_uncertainty():
    mapper = mapper_of(sensor=PerfectModel(), horizontal_variances=True)
    mapper.update(cloud(), UP, timestamp=0)
    fused = mapper.fused_map()
    for name, layer in mapper.grid_map.items():
        np.testing.assert_allclose(fused[name], layer, rtol=1e-5, atol=1e-6)


def test_motion_adds_horizontal_variance():
    mapper = mapper_of(horizontal_variances=True)
    mapper.update(cloud(), UP, timestamp=0, pose_covariance=np.zeros((6, 6)))
    before = mapper.grid_map["horizontal_variance"].copy()
    covariance = np.diag([1e-4, 3e-4, 0.0, 0.0, 0.0, 0.02])
    mapper.update(np.empty((0, 3)), UP, timestamp=1, pose_covariance=covariance)
    x, y = mapper.grid_map.get_position((1, 2))
    added = mapper.grid_map["horizontal_variance"][1, 2] - before[1, 2]
    assert added == pytest.approx(2e-4 + 0.01 * (x * x + y * y), rel=1e-3)
