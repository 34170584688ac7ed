# SPDX-License-Identifier: BSD-3-Clause
"""`RollingMap` fuses clouds one after the other while the map moves."""

import math
import statistics
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from grid_map_core_py import ConfigError, GeometryError, GridGeometry, GridMapError
from grid_map_core_py.elevation import RollingMap
from grid_map_core_py.testing import assert_maps_equal

SIDE = 0.5
ROWS, COLUMNS = 4, 6
GEOMETRY = GridGeometry(np.array([ROWS * SIDE, COLUMNS * SIDE]), SIDE)

Point = tuple[float, float, float]
Step = tuple[tuple[float, float], list[Point]]


def steps() -> st.SearchStrategy[list[Step]]:
    """Centers that the map moves to, near or far, with clouds; no point is on a cell border."""
    away = st.floats(-1.2, 1.2) | st.sampled_from([0.0, 0.6, -5.0])
    offsets = st.integers(-9, 9).map(lambda k: 0.25 * SIDE * (2 * k + 1) + 0.01)
    heights = st.floats(-9, 9, width=32) | st.sampled_from([math.nan, math.inf])
    clouds = st.lists(st.tuples(offsets, offsets, heights), max_size=12)
    return st.lists(st.tuples(st.tuples(away, away), clouds), max_size=6)


class ByHand:
    """Oracle: the heights of every cell of the world, cloud by cloud, in lists."""

    def __init__(self) -> None:
        self.position = [0.0, 0.0]
        self.cells: dict[tuple[int, int], list[list[float]]] = {}

    def fuse(self, position: tuple[float, float], points: list[Point]) -> None:
        for axis in (0, 1):
            cells = (position[axis] - self.position[axis]) / SIDE
            self.position[axis] += SIDE * math.copysign(math.floor(abs(cells) + 0.5), cells)
        self.cells = {cell: clouds for cell, clouds in self.cells.items() if self._holds(cell)}
        new: dict[tuple[int, int], list[float]] = {}
        for x, y, z in points:
            cell = math.floor(x / SIDE), math.floor(y / SIDE)
            if math.isfinite(z) and self._holds(cell):
                new.setdefault(cell, []).append(z)
        for cell, heights in new.items():
            self.cells.setdefault(cell, []).append(heights)

    def layer(self, make: Any, empty: float = math.nan) -> np.ndarray:
        first = [round(self.position[k] / SIDE) + n // 2 - 1 for k, n in enumerate((ROWS, COLUMNS))]
        values = np.full((ROWS, COLUMNS), empty)
        for i, j in np.ndindex(values.shape):
            if clouds := self.cells.get((first[0] - i, first[1] - j)):
                values[i, j] = make(clouds)
        return values

    def _holds(self, cell: tuple[int, int]) -> bool:
        return all(
            abs((cell[k] + 0.5) * SIDE - self.position[k]) < 0.5 * SIDE * n
            for k, n in enumerate((ROWS, COLUMNS))
        )


def flat(clouds: list[list[float]]) -> list[float]:
    return [height for heights in clouds for height in heights]


EXPECTED = {
    ("max", "max"): lambda clouds: max(flat(clouds)),
    ("max", "median"): lambda clouds: max(map(statistics.median, clouds)),
    ("min", "min"): lambda clouds: min(flat(clouds)),
    ("last", "max"): lambda clouds: max(clouds[-1]),
    ("last", "mean"): lambda clouds: statistics.fmean(clouds[-1]),
    ("last", "first"): lambda clouds: clouds[-1][0],
    ("mean", "max"): lambda clouds: statistics.fmean(flat(clouds)),
}


def moved_through(rolling: RollingMap, journey: list[Step]) -> ByHand:
    oracle = ByHand()
    place = np.zeros(2)
    for by, cloud in journey:
        place = place + by
        base = SIDE * np.round(place / SIDE)
        points = [(base[0] + x, base[1] + y, z) for x, y, z in cloud]
        rolling.fuse(np.array(points).reshape(-1, 3), position=place)
        oracle.fuse(tuple(place), points)
        np.testing.assert_allclose(rolling.grid_map.position, oracle.position, atol=1e-9)
    return oracle


@pytest.mark.parametrize(("fusion", "reduction"), EXPECTED)
@settings(max_examples=30)
@given(journey=steps())
def test_layers_equal_collecting_by_hand(fusion: str, reduction: str, journey: list[Step]) -> None:
    rolling = RollingMap(GEOMETRY, fusion=fusion, reduction=reduction)
    oracle = moved_through(rolling, journey)
    found = rolling.grid_map.unwrapped("elevation")
    expected = oracle.layer(EXPECTED[fusion, reduction])
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)
    if fusion == "mean":
        assert rolling.grid_map.layers == ("elevation", "variance", "count")
        variance = oracle.layer(lambda clouds: statistics.pvariance(flat(clouds)))
        found = rolling.grid_map.unwrapped("variance")
        np.testing.assert_allclose(found, variance, rtol=1e-4, atol=1e-4)
        count = oracle.layer(lambda clouds: len(flat(clouds)), empty=0)
        np.testing.assert_array_equal(rolling.grid_map.unwrapped("count"), count)


def test_many_clouds_far_above_zero_keep_their_mean_and_variance() -> None:
    rng = np.random.default_rng(5)
    rolling = RollingMap(GridGeometry(np.array([1.0, 1.0]), 1.0), fusion="mean")
    heights = rng.normal(1000.0, 0.5, (200, 50))
    for cloud in heights:
        rolling.fuse(np.column_stack([np.zeros((50, 2)), cloud]))
    found = {name: layer.item() for name, layer in rolling.grid_map.items()}
    assert found["count"] == heights.size
    assert found["elevation"] == pytest.approx(heights.mean(), abs=1e-3)
    assert found["variance"] == pytest.approx(heights.var(), rel=1e-2)


@pytest.mark.filterwarnings("error")
def test_huge_heights_affect_only_their_own_cell() -> None:
    rolling = RollingMap(GEOMETRY, fusion="mean")
    for _ in range(3):
        rolling.fuse([(0.1, 0.1, 3e38), (0.1, 0.1, -3e38), (0.7, 0.1, 2.0)])
    assert rolling.grid_map.at_position("elevation", (0.7, 0.1)) == 2.0
    assert rolling.grid_map.at_position("count", (0.7, 0.1)) == 3.0


def test_limited_mean_follows_new_points() -> None:
    rolling = RollingMap(GridGeometry(np.array([1.0, 1.0]), 1.0), fusion="mean", max_count=10)
    for height in [0.0] * 100 + [1.0] * 10:
        rolling.fuse([(0, 0, height)])
    # Each of the last ten updates keeps 10/11 of the previous value.
    assert rolling.grid_map["elevation"].item() == pytest.approx(1 - (10 / 11) ** 10, rel=1e-5)
    assert rolling.grid_map["count"].item() == 11


def test_other_values_come_from_the_last_cloud_with_any() -> None:
    rolling = RollingMap(GEOMETRY)
    place = (0.1, 0.1)
    for values in ([1.0, 3.0], [math.nan, 5.0], [math.nan, math.nan]):
        rolling.fuse([(*place, 0.0)] * 2, {"intensity": np.array(values)})
    rolling.fuse([(*place, 2.0)])
    assert rolling.grid_map["intensity"][rolling.grid_map.get_index(place)] == 5.0
    assert rolling.grid_map["elevation"][rolling.grid_map.get_index(place)] == 2.0
    assert np.isnan(rolling.grid_map["intensity"]).sum() == ROWS * COLUMNS - 1


def test_values_move_with_the_map() -> None:
    rolling = RollingMap(GEOMETRY)
    rolling.fuse([(0.1, 0.1, 1.0)], {"intensity": np.array([7.0])})
    rolling.fuse(np.empty((0, 3)), position=(0.5, -1.0))
    assert rolling.grid_map.start_index != (0, 0)
    assert rolling.grid_map["intensity"][rolling.grid_map.get_index((0.1, 0.1))] == 7.0
    rolling.fuse([(0.1, 0.1, 1.0)], {"intensity": np.array([9.0])})
    assert rolling.grid_map["intensity"][rolling.grid_map.get_index((0.1, 0.1))] == 9.0
    rolling.move((50.0, 0.0))
    assert np.isnan(rolling.grid_map["intensity"]).all()


def test_points_beyond_the_height_limits_are_left_out() -> None:
    rolling = RollingMap(GEOMETRY, min_height=0.0, max_height=1.0)
    points = [(0.1, 0.1, 0.5), (0.1, 0.1, 1.5), (0.7, 0.1, -0.5), (99, 0, 0.5), (0, 0, math.nan)]
    reasons = "not finite", "below min_height", "above max_height", "outside the map"
    assert rolling.fuse(points) == dict.fromkeys(reasons, 1)
    assert np.nansum(rolling.grid_map["elevation"]) == 0.5


def test_a_map_knows_its_frame_basic_layer_and_time() -> None:
    rolling = RollingMap(GEOMETRY, "odom", layer="ground")
    rolling.fuse([(0, 0, 0)], timestamp=5)
    rolling.fuse([(0, 0, 0)])
    grid_map = rolling.grid_map
    assert (grid_map.frame_id, grid_map.timestamp) == ("odom", 5)
    assert (grid_map.layers, grid_map.basic_layers) == (("ground",), ("ground",))


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"points": np.zeros((2, 2))}, GeometryError),
        ({"columns": {"elevation": np.zeros(1)}}, GridMapError),
        ({"columns": {"count": np.zeros(1)}}, GridMapError),
        ({"columns": {"intensity": np.zeros(3)}}, GeometryError),
        ({"position": (math.nan, 0.0)}, GeometryError),
        ({"position": (1e300, 0.0)}, GeometryError),
        ({"transform": 2 * np.eye(4)}, GeometryError),
    ],
)
def test_failed_fusion_keeps_the_map(wrong: dict[str, Any], error: type[Exception]) -> None:
    rolling = RollingMap(GEOMETRY, fusion="mean")
    rolling.fuse([(0, 0, 1)], position=(0.5, 0.5), timestamp=5)
    before = rolling.grid_map.copy()
    fine = {"points": [(0, 0, 2)], "position": (3.0, 1.0), "timestamp": 9}
    with pytest.raises(error):
        rolling.fuse(**{**fine, **wrong})
    assert_maps_equal(rolling.grid_map, before)
    assert rolling.grid_map.start_index == before.start_index


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"fusion": "median"}, "'fusion': expected one of max, min, mean, last, got 'median'"),
        ({"reduction": "count"}, "'reduction': expected one of max, min, mean, median, first"),
        ({"max_count": -1}, "'max_count': expected a number of points"),
        ({"fusion": "mean", "layer": "count"}, "'layer': expected another name"),
        ({"min_height": 2.0, "max_height": 1.0}, "min_height, max_height: expected ascending"),
    ],
)
def test_wrong_settings_are_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        RollingMap(GEOMETRY, **wrong)
    with pytest.raises(GridMapError, match="non-empty string"):
        RollingMap(GEOMETRY, layer="")


def test_points_are_moved_one_by_one() -> None:
    points = np.random.default_rng(2).uniform(-9, 9, (20, 3)).astype(np.float32)
    points[3, 1], points[4, 0] = math.nan, math.inf
    transform = np.eye(4)
    transform[:3] = [[0, -0.6, 0.8, 2], [1, 0, 0, -1], [0, 0.8, 0.6, 3]]
    heights = RollingMap(GridGeometry((40, 40), 40.0), fusion="mean")
    heights.fuse(points, transform=transform)
    moved = [transform @ (*p, 1.0) for p in points.tolist() if np.isfinite(p).all()]
    assert heights.grid_map["count"].item() == len(moved) == 18
    mean = statistics.fmean(p[2] for p in moved)
    assert heights.grid_map["elevation"].item() == pytest.approx(mean)


def test_range_is_measured_from_the_sensor() -> None:
    transform = np.eye(4)
    transform[:2, 3] = 1.0, -0.5
    rolling = RollingMap(GEOMETRY, fusion="mean")
    points = [(0.1, 0, 0), (-1, 0, 2), (-1, 0, 9), (math.nan, 0, 0)]
    columns = {"n": np.arange(4.0)}
    found = rolling.fuse(points, columns, transform=transform, min_range=1.0, max_range=5.0)
    reasons = "nearer than min_range", "farther than max_range", "not finite"
    assert found == dict.fromkeys(reasons, 1)
    assert rolling.grid_map["count"].sum() == 1
    assert np.nansum(rolling.grid_map["n"]) == 1.0
