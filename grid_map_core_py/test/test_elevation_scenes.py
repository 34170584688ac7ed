# SPDX-License-Identifier: BSD-3-Clause
"""Elevation maps of ground where obstacles come and go, from sparse scans to dense ones.

A sensor 1 m above level ground sees 4 m x 6 m of it, ten times a second, in cells of 0.1 m.
"""

import numpy as np
import pytest

from grid_map_core_py import GridGeometry
from grid_map_core_py.elevation import ConstantModel, ElevationMapper, LaserModel

# NumPy alone would take minutes.
pytestmark = pytest.mark.needs("numba")

POSE = np.eye(4)
POSE[2, 3] = 1.0
PERIOD = 100_000_000
HIGH = 0.5
"""Height [m] above which a cell shows an obstacle."""


def ground(random, count, noise=0.005):
    x, y = random.uniform((-2.0, -3.0), (2.0, 3.0), (count, 2)).T
    return np.column_stack((x, y, random.normal(0.0, noise, count)))


def wall(random, count, top=1.2):
    """Points of a wall of 2 m, from the floor up, in one row of cells."""
    x, y = random.normal(1.55, 0.005, count), random.uniform(-1.0, 1.0, count)
    return np.column_stack((x, y, random.uniform(0.0, top, count)))


def person(random, count, center=(1.55, 0.0), height=1.7):
    """Points of an upright cylinder of 0.4 m."""
    angle = random.uniform(0.0, 2.0 * np.pi, count)
    x, y = center[0] + 0.2 * np.cos(angle), center[1] + 0.2 * np.sin(angle)
    return np.column_stack((x, y, random.uniform(0.0, height, count)))


class Scene:
    """A map, and the time of its next scan."""

    def __init__(self, resolution=0.1, **parameters):
        parameters = {"sensor": LaserModel()} | parameters
        self.mapper = ElevationMapper(GridGeometry((8.0, 8.0), resolution), **parameters)
        self.count = 0

    def see(self, *parts):
        points = np.vstack(parts)
        self.count += 1
        return self.mapper.update(points - POSE[:3, 3], POSE, timestamp=self.count * PERIOD)

    def heights(self, places):
        """Return the heights of the distinct cells of places (N, 2) [m]."""
        rows, columns = np.unique(self.mapper.grid_map.get_indices(places)[0], axis=1)
        return self.mapper.grid_map["elevation"][rows, columns]

    def shown(self, places):
        """Return the share of the cells of places (N, 2) that show an obstacle."""
        return np.mean(self.heights(places) > HIGH)


WALL = np.column_stack((np.full(20, 1.55), np.linspace(-0.95, 0.95, 20)))
OBSTACLES = {
    "wall": (wall, WALL),
    "person": (person, person(np.random.default_rng(0), 2000)[:, :2]),
}


@pytest.mark.parametrize("count", [1_000, 10_000, 60_000])
@pytest.mark.parametrize("name", OBSTACLES)
def test_obstacle_enters_the_map_and_leaves_it(name, count):
    obstacle, places = OBSTACLES[name]
    found = []
    for scans_before in (0, 15):
        random, scene = np.random.default_rng(1), Scene()
        for _ in range(scans_before):
            scene.see(ground(random, 10_000))
        for number in range(1, 13):
            scene.see(ground(random, 10_000), obstacle(random, count))
            assert number < 3 or scene.shown(places) >= 0.95
        found.append(scene.heights(places))
        for _ in range(15):
            scene.see(ground(random, 10_000))
        assert scene.shown(places) == 0.0
    # Known ground makes no difference.
    assert np.mean(np.abs(found[1] - found[0]) < 0.15) >= 0.9


def test_wall_enters_from_its_foot_up():
    random, scene = np.random.default_rng(2), Scene()
    for top in np.linspace(0.05, 1.2, 24):
        scene.see(wall(random, 4000, top))
    assert scene.shown(WALL) == 1.0


def test_wall_stays_for_sixty_scans():
    random, scene = np.random.default_rng(3), Scene()
    for _ in range(60):
        scene.see(ground(random, 10_000), wall(random, 10_000))
    heights = scene.heights(WALL)
    assert ((heights > 1.0) & (heights < 1.25)).all()


def test_wall_in_coarse_cells_is_known_from_one_point_on():
    random, scene = np.random.default_rng(11), Scene(0.5)
    scene.see(ground(random, 10_000), [(1.55, 1.1, 1.15)])
    assert scene.heights([(1.55, 1.1)]) == pytest.approx(0.0, abs=0.1)
    scene.see(ground(random, 10_000), wall(random, 10_000))
    assert scene.shown(WALL) == 1.0
    assert np.isfinite(scene.heights(ground(random, 10_000)[:, :2])).all()
    scene.mapper.clear()
    scene.see([(1.55, 1.1, 1.15), (1.55, 0.6, 0.2)])
    assert scene.shown([(1.55, 1.1)]) == 1.0


@pytest.mark.parametrize(("resolution", "share", "top"), [(0.5, 0.8, 0.18), (0.25, 0.5, 0.09)])
def test_low_box_in_known_cell_counts_as_on_unknown_ground(resolution, share, top):
    heights = []
    for scans_before in (0, 15):
        random, scene = np.random.default_rng(12), Scene(resolution)
        for number in range(scans_before + 5):
            points = ground(random, 20_000)
            x = points[:, 0] / resolution % 1.0
            points[(x < share) & (number >= scans_before), 2] += top
            scene.see(points)
        heights.append(np.median(scene.mapper.grid_map["elevation"][8:10, 8:10]))
        assert 0.3 * top < heights[-1] < top
    assert heights[1] == pytest.approx(heights[0], abs=0.1 * top)


def test_walking_person_is_in_the_map_and_leaves_no_trail():
    random, scene, since, shown = np.random.default_rng(4), Scene(), {}, []
    for _ in range(15):
        scene.see(ground(random, 10_000))
    for y in np.arange(-2.5, 2.5, 0.14):
        around = ground(random, 10_000)
        around = around[np.linalg.norm(around[:, :2] - (1.55, y), axis=1) > 0.2]
        scene.see(around, person(random, 3000, (1.55, y)))
        elevation = scene.mapper.grid_map["elevation"]
        outline = person(random, 2000, (1.55, y))[:, :2]
        shown.append(scene.shown(outline) > 0.8)
        positions = scene.mapper.grid_map.get_positions()
        is_away = np.linalg.norm(positions - (1.55, y), axis=1) > 0.35
        high = np.flatnonzero((elevation.ravel("F") > HIGH) & is_away)
        since = {cell: since.get(cell, 0) + 1 for cell in high.tolist()}
        assert max(since.values(), default=0) <= 15
    assert np.mean(shown) >= 0.8


OUTLIERS = [(share, count) for share in (0.001, 0.01, 0.05) for count in (6_000, 60_000)]


@pytest.mark.parametrize("low", [0.0, -1.0], ids=["above", "around"])
@pytest.mark.parametrize(("share", "count"), [*OUTLIERS, (0.05, 300_000)])
def test_outliers_leave_the_ground(share, count, low):
    random, scene = np.random.default_rng(5), Scene()
    for _ in range(20):
        points = ground(random, count)
        wrong = random.random(count) < share
        points[wrong, 2] = random.uniform(low, low + 2.0, wrong.sum())
        scene.see(points)
    places = ground(random, 100_000)[:, :2]
    heights = scene.heights(places)
    limit = {0.001: 0.001, 0.01: 0.005, 0.05: 0.06 if count == 300_000 else 0.02}[share]
    assert np.mean(np.abs(heights) > 0.1) <= limit
    assert np.mean(np.isnan(heights)) <= 0.01


@pytest.mark.parametrize("count", [30, 100])
def test_poles_beside_mapped_ground_rise(count):
    random, scene = np.random.default_rng(6), Scene()
    centers = [(x, y) for x in (-1.45, 0.55, 1.55) for y in np.arange(-2.45, 2.5, 0.5)]

    def flat():
        around = [(*c, 0.0) + random.uniform((-0.05,) * 3, 0.05, (100, 3)) for c in centers]
        points = np.vstack(around)
        points[:, 2] = random.normal(0.0, 0.005, len(points))
        return points

    def poles():
        parts = []
        for x, y in centers:
            angle = random.uniform(0.0, 2.0 * np.pi, count)
            z = random.uniform(0.0, 1.2, count)
            parts.append(np.column_stack((x + 0.025 * np.cos(angle), y + 0.025 * np.sin(angle), z)))
        return np.vstack(parts)

    for _ in range(15):
        scene.see(flat())
    for _ in range(10):
        scene.see(flat(), poles())
    assert scene.shown(centers) == 1.0


def test_pit_opens_in_known_ground():
    random, scene = np.random.default_rng(7), Scene()
    for _ in range(20):
        scene.see(ground(random, 20_000))

    def with_pit(points):
        # Beams reach the floor of the pit behind its near edge.
        x, y, _ = points.T
        inside = (x > 0.8) & (x < 1.8) & (np.abs(y) < 0.5)
        floor = points[inside]
        floor[:, 2] = random.normal(-0.4, 0.005, len(floor))
        seen = 1.0 + 0.8 / floor[:, 0] * (floor[:, 2] - 1.0) > 0.0
        return np.vstack((points[~inside], floor[seen]))

    for _ in range(15):
        scene.see(with_pit(ground(random, 20_000)))
    x, y = np.meshgrid(np.arange(1.35, 1.7, 0.1), np.arange(-0.35, 0.4, 0.1))
    heights = scene.heights(np.column_stack((x.ravel(), y.ravel())))
    assert np.nanmax(heights) < -0.35
    assert np.isfinite(heights).mean() > 0.9


def test_constant_model_makes_a_map_by_its_default():
    random, scene = np.random.default_rng(8), Scene(sensor=ConstantModel())
    report = scene.see(ground(random, 20_000))
    assert report.points_used > 19_000
    assert np.isfinite(scene.heights(ground(random, 20_000)[:, :2])).all()


def test_points_lost_to_a_limit_are_counted_with_the_reason():
    random = np.random.default_rng(9)
    scene = Scene(sensor=ConstantModel(), max_variance=0.01, max_range=2.5)
    points = np.vstack((ground(random, 2000), [(np.nan, 0, 0), (3.9, 3.9, 0.0), (9.0, 0.0, 0.0)]))
    report = scene.see(points)
    assert sum(report.reasons.values()) == report.points_dropped
    assert report.reasons["not finite, or at the origin of the sensor"] == 1
    assert report.reasons["farther than max_range"] > 300
    assert report.reasons["in cells more uncertain than max_variance"] > 1000
    assert report.points_used + report.points_gated + report.points_dropped == len(points)
