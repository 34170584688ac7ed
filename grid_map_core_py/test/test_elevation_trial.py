# SPDX-License-Identifier: BSD-3-Clause
"""Elevation mapping in hard scenes: stairs, drift, reflections, uncertain poses, ramps, tables."""

import math
from functools import cache

import numpy as np
import pytest
from boxes_world import World, height_at, measured, pose_of, walking

from grid_map_core_py import GridGeometry
from grid_map_core_py.elevation import ElevationMapper, LaserModel, StructuredLightModel
from grid_map_core_py.simulation import DepthCamera, SpinningLidar

# NumPy alone would take minutes.
pytestmark = pytest.mark.needs("numba")

RESOLUTION = 0.1
START, PERIOD = 1_000_000_000, 100_000_000
"""Time of the first scan, and between two scans [ns]."""

LEVEL = World()
BOXES = World(
    [
        [1.5, 2.0, -2.0, -1.5, 0.0, 0.3],
        [3.0, 3.5, 1.0, 1.6, 0.0, 0.5],
        [5.0, 5.3, -1.0, 2.0, 0.0, 1.2],
        [6.0, 6.6, -3.0, -2.4, 0.0, 0.8],
    ]
)
SLABS = World(
    [
        [x, x + 0.5, y, y + 0.4, -0.1, 0.1 * abs(y) / 3]
        for x in (0.4, 2.3, 4.1, 5.9)
        for y in (-2.6, -1.2, 0.9, 2.1)
    ]
)
EVEN = LaserModel(min_radius=0.005, beam_constant=0.005, beam_angle=0.0)
"""Model of points with a standard deviation of 5 mm in all directions."""


# Small parts


def lidar(rings=16, azimuths=360):
    return SpinningLidar(rings=rings, lowest=-0.6, highest=0.0, azimuths=azimuths).directions


def mapper(length, sensor=None, **parameters):
    geometry = GridGeometry((length, length), RESOLUTION)
    return ElevationMapper(geometry, sensor=sensor or LaserModel(), **parameters)


def update(made, points, pose, number, **arguments):
    """Fuse scan `number`, counted from 0."""
    return made.update(points, pose, timestamp=START + number * PERIOD, **arguments)


def known(made):
    """Return x, y, height and variance (4, n) of the known cells."""
    names = "elevation", "variance"
    heights, variances = (made.grid_map.unwrapped(name).ravel("F").astype(float) for name in names)
    seen = np.isfinite(heights)
    return np.vstack((made.grid_map.get_positions()[seen].T, heights[seen], variances[seen]))


def cells_of(x, y):
    """Return the cells at places as a list of (i, j), counted along x and y from the origin."""
    return list(zip(*(np.floor(v / RESOLUTION).astype(int).tolist() for v in (x, y)), strict=True))


def relief(world, x, y, margin=0.05):
    """Return the lowest and highest surface within cells and a margin around them [m]."""
    offsets = np.linspace(-1.0, 1.0, 5) * (0.5 * RESOLUTION + margin)
    along, across = (offset.ravel() for offset in np.meshgrid(offsets, offsets))
    heights = height_at(world, x[:, None] + along, y[:, None] + across)
    return heights.min(axis=1), heights.max(axis=1)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def error_over_claim(errors, variances):
    """Return the rms of errors over that of the claimed deviations."""
    return rms(errors) / math.sqrt(np.mean(variances))


def spread_points(random, length, per_cell, height, slope=0.0, noise=0.005):
    """Return points (n, 3) at random places of a square plane, seen from `height` [m] above it."""
    count = round(per_cell * (length / RESOLUTION) ** 2)
    x, y = random.uniform(-0.5 * length, 0.5 * length, (2, count))
    return np.stack((x, y, slope * x - height + random.normal(0.0, noise, count)), axis=1)


# Drift compensation

CAMERA = DepthCamera(width=80, height=45).directions
RISE, TREAD, STEPS = 0.16, 0.30, 80
SHIFT = 0.03
"""Distance of the steps from borders of cells [m]."""


def stairs_near(x):
    """Return the steps that a camera at x can see, and the landing behind the last one."""
    first, last = max(int((x - 0.5) / TREAD), 0), min(int((x + 3.5) / TREAD), STEPS)
    numbers = np.arange(first, last)
    boxes = np.zeros((len(numbers), 6))
    boxes[:, 0], boxes[:, 1] = TREAD * numbers + SHIFT, TREAD * (numbers + 1) + SHIFT
    boxes[numbers == STEPS - 1, 1] += 10.0
    boxes[:, 2:4], boxes[:, 4:] = (-2.0, 2.0), RISE * np.stack((numbers - 5, numbers + 1), axis=1)
    return World(boxes)


def looking_ahead(position, down):
    """Return the pose of a camera that looks along x and by an angle `down` [rad]."""
    sine, cosine = math.sin(down), math.cos(down)
    pose = pose_of(position)
    pose[:3, :3] = np.array([[0.0, -sine, cosine], [-1.0, 0.0, 0.0], [0.0, -cosine, -sine]])
    return pose


def depth_noise(ranges):
    """Return about the deviation that `StructuredLightModel` claims [m]."""
    return 0.000611 + 0.003587 * (ranges - 0.3515) ** 2


def test_drift_compensation_ignores_stairs():
    random, total = np.random.default_rng(0), 0.0
    made = mapper(5.0, StructuredLightModel(), enable_drift_compensation=True)
    for number, x in enumerate(np.arange(-2.0, STEPS * TREAD, 0.08)):
        pose = looking_ahead((x, 0.0, max(x, 0.0) * RISE / TREAD + 0.8), 0.2)
        noise = {"along": depth_noise, "across": (0.0, 0.01576), "max_range": 5.0}
        points = measured(stairs_near(x), CAMERA, pose, random, **noise)
        report = update(made, points, pose, number, position=(x + 1.0, 0.0))
        total += report.drift * made.parameters.drift_compensation_alpha
    assert abs(total) <= 0.005


def test_drift_of_one_percent_leaves_small_errors():
    random, drift = np.random.default_rng(1), 0.01
    made = mapper(8.0, enable_drift_compensation=True)
    for number, pose in enumerate(walking(SLABS, 260, 0.3)):
        points, given = measured(SLABS, lidar(), pose, random), pose.copy()
        given[2, 3] += drift * pose[0, 3]
        update(made, points, given, number, position=pose[:2, 3])
    x, y, heights, _ = known(made)
    low, high = relief(SLABS, x, y)
    errors = (heights - low - drift * pose[0, 3])[high == low]
    assert len(errors) > 5000
    assert rms(errors) <= 1.1 * 0.0034


# Reflections


def reflected(points, pose, share, random):
    """Move a share of the points on the ground along their beams to 0.05 to 1 m below it."""
    rise = points @ pose[2, :3]
    chosen = (np.abs(rise + pose[2, 3]) < 0.1) & (random.random(len(points)) < share)
    depths = random.uniform(0.05, 1.0, len(points))
    return points * np.where(chosen, -(pose[2, 3] + depths) / rise, 1.0)[:, None]


@cache
def walk_with_reflections(rings, share):
    """Return the error of each known cell, by cell, after a walk of 80 scans [m]."""
    made, random, other = mapper(10.0), np.random.default_rng(3), np.random.default_rng(4)
    for number, pose in enumerate(walking(BOXES, 80, 0.5)):
        points = measured(BOXES, lidar(rings), pose, random)
        points = reflected(points, pose, share, other)
        update(made, points, pose, number, position=pose[:2, 3])
    x, y, heights, _ = known(made)
    return dict(zip(cells_of(x, y), heights - relief(BOXES, x, y)[0], strict=True))


@pytest.mark.parametrize("rings", [16, 32])
@pytest.mark.parametrize("share", [0.001, 0.01])
def test_reflections_leave_cells_known_and_lower_few(rings, share):
    without, found = walk_with_reflections(rings, 0.0), walk_with_reflections(rings, share)
    assert len(without) > 7000
    # Without reflections, cells in shadows are unknown.
    both = without.keys() & found
    assert len(both) >= 0.98 * len(without)
    low = np.array([found[cell] for cell in both]) < -0.1
    assert low.mean() <= 0.01


# Uncertain poses


def test_growing_pose_covariance_leaves_cells_known():
    made, random, counts = mapper(8.0), np.random.default_rng(3), []
    for number, pose in enumerate(walking(LEVEL, 201, 1.0)):
        points = measured(LEVEL, lidar(), pose, random)
        covariance = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) * 1e-3 * pose[0, 3]
        given = {"pose_covariance": covariance, "position": pose[:2, 3]}
        update(made, points, pose, number, **given)
        counts.append(known(made).shape[1])
    # The sway changes the number of known cells from scan to scan; a mean over a second does not.
    early, late = np.mean(counts[41:51]), np.mean(counts[191:201])
    assert early > 5000
    assert late >= 0.97 * early


@pytest.mark.parametrize(
    ("speed", "sway"), [pytest.param(0.0, 0.0, id="standing"), pytest.param(0.5, 3.0, id="walking")]
)
def test_undeclared_pose_noise_keeps_level_ground_known_and_unbiased(speed, sway):
    cleared, seen, errors = 0, 0, []
    for seed in range(3):
        made, random, cells = mapper(8.0), np.random.default_rng(seed), set()
        for number, pose in enumerate(walking(LEVEL, 60, speed, sway=sway)):
            rise, roll, pitch = random.normal(0.0, [0.01, math.radians(0.3), math.radians(0.3)])
            true = pose_of(pose[:3, 3] + (0.0, 0.0, rise), roll, pitch)
            true[:3, :3] = true[:3, :3] @ pose[:3, :3]
            points = measured(LEVEL, lidar(), true, random)
            report = update(made, points, pose, number, position=pose[:2, 3])
            cleared += report.cells_cleared
            x, y, heights, _ = known(made)
            cells.update(cells_of(x, y))
        seen += len(cells)
        errors.append(heights.mean())
    assert cleared <= 0.003 * seen
    assert abs(np.mean(errors)) <= 0.005


def test_variance_covers_declared_pose_noise():
    covariance = np.diag([0.0, 0.0, 1e-4, 0.0, 0.0, 0.0])
    ratios = np.zeros((100, 10))
    for seed in range(len(ratios)):
        made, random = mapper(0.5), np.random.default_rng(seed)
        for number in range(10):
            points = spread_points(random, 0.5, 50, 2.0)
            points[:, 2] += random.normal(0.0, 0.01)
            update(made, points, pose_of((0.0, 0.0, 2.0)), number, pose_covariance=covariance)
            _, _, heights, variances = known(made)
            ratios[seed, number] = np.mean(heights**2 / variances)
    assert (ratios.mean(axis=0)[[0, 2, 9]] <= 3.0).all()


@pytest.mark.parametrize("min_variance", [9e-6, 1e-9])
def test_minute_of_standing_keeps_error_near_the_claim(min_variance):
    made, random, ratios = mapper(4.0, min_variance=min_variance), np.random.default_rng(0), []
    pose = pose_of((0.0, 0.0, 0.7))
    directions = lidar(azimuths=180)
    for number in range(600):
        points = measured(LEVEL, directions, pose, random, max_range=6.0)
        update(made, points, pose, number)
        _, _, heights, variances = known(made)
        ratios.append(error_over_claim(heights, variances))
    assert len(heights) > 900
    assert ratios[599] <= 1.5 * ratios[9]


# Ramps

RAMPS = pytest.mark.parametrize(
    ("degrees", "bias"), [(10, 0.002), (20, 0.003), (30, 0.005), (40, 0.008)]
)


def check_ramp(made, slope, bias, least):
    x, y, heights, variances = known(made)
    away = np.abs(np.stack((x, y), axis=1) - made.grid_map.position)
    inside = (away < 0.5 * made.grid_map.length - 0.2).all(axis=1)
    errors = (heights - slope * x)[inside]
    assert len(errors) > least
    assert abs(errors.mean()) <= bias
    assert error_over_claim(errors, variances[inside]) <= 1.6


@RAMPS
def test_dense_points_of_ramp_give_height_at_centers(degrees, bias):
    slope, random = math.tan(math.radians(degrees)), np.random.default_rng(0)
    made = mapper(4.0, EVEN)
    for number in range(10):
        points = spread_points(random, 4.0, 25, 3.0, slope)
        update(made, points, pose_of((0.0, 0.0, 3.0)), number)
    check_ramp(made, slope, bias, 1200)


@RAMPS
def test_walk_on_ramp_gives_height_at_centers(degrees, bias):
    slope, random = math.tan(math.radians(degrees)), np.random.default_rng(0)
    world, made = World(slope=slope), mapper(8.0)
    for number, pose in enumerate(walking(world, 60, 0.5)):
        points = measured(world, lidar(), pose, random)
        update(made, points, pose, number, position=pose[:2, 3])
    check_ramp(made, slope, bias, 5000)


# Overhangs

TABLE = 0.6, 0.75
"""Length of the table and height of its top [m]."""


def mapped_table(before, on_table=20, **parameters):
    """Return a map of a table, and its cells.

    Either the ground is mapped `before` scans earlier, or the table `-before` scans.
    """
    made, random, (length, top) = mapper(2.0, EVEN, **parameters), np.random.default_rng(0), TABLE
    for number in range(abs(before) + 5):
        points = spread_points(random, 2.0, 20, 3.0)
        table = spread_points(random, length, on_table, 3.0 - top)
        is_later = number >= abs(before)
        seen = [points] * (is_later or before > 0) + [table] * (is_later or before < 0)
        update(made, np.vstack(seen), pose_of((0.0, 0.0, 3.0)), number)
    grid_map = made.grid_map
    below = (np.abs(grid_map.get_positions()) < 0.5 * length).all(axis=1)
    assert below.sum() == 36
    return grid_map, below


@pytest.mark.parametrize(("before", "on_table"), [(0, 20), (3, 20), (-3, 20), (3, 90), (3, 3)])
def test_overhang_clearance_keeps_ground_below_table(before, on_table):
    grid_map, below = mapped_table(before, on_table, overhang_clearance=0.6)
    ground, overhang = (grid_map.unwrapped(name).ravel("F") for name in ("elevation", "overhang"))
    assert np.abs(ground).max() < 0.02
    assert np.nanmax(np.abs(overhang[below] - TABLE[1])) <= 0.03
    assert np.isfinite(overhang[below]).mean() > 0.9
    assert np.isnan(overhang[~below]).all()


@pytest.mark.parametrize("before", [0, 3])
def test_table_is_the_surface_without_clearance(before):
    grid_map, below = mapped_table(before)
    heights = grid_map.unwrapped("elevation").ravel("F")
    assert np.abs(heights[below] - TABLE[1]).max() <= 0.02
    assert np.abs(heights[~below]).max() < 0.02


def test_overhangs_are_forgotten_without_clearance():
    made = mapper(1.0, EVEN, overhang_clearance=0.6)
    update(made, [(0.0, 0.0, z) for z in (-2.0, -2.0, -1.0, -1.0)], pose_of((0.0, 0.0, 2.0)), 0)
    assert np.nanmax(made.grid_map["overhang"]) == pytest.approx(1.0)
    made.configure(overhang_clearance=0.0)
    assert "overhang" not in made.grid_map
