# SPDX-License-Identifier: BSD-3-Clause
"""Accuracy of elevation mapping on known terrain, measured by a simulated lidar of 16 rings."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.elevation import ElevationMapper, LaserModel
from grid_map_core_py.simulation import SpinningLidar, scan, with_box, with_ramp, with_stairs

# NumPy alone would take minutes.
pytestmark = pytest.mark.needs("numba")

RESOLUTION = 0.1
LIDAR = SpinningLidar(lowest=-0.6, highest=0.0, azimuths=360).directions
HEIGHT = 0.7
"""Height of the lidar above level ground [m]."""

PERIOD = 100_000_000
"""Time between two scans [ns]."""


@cache
def ground():
    """Return rough and level ground with stairs, a ramp and boxes."""
    grid_map = GridMap((12.0, 12.0), RESOLUTION / 2, layers=["elevation"])
    x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
    grid_map["elevation"] = np.where(x < -1.5, 0.02 * np.sin(2.1 * x) * np.cos(1.7 * y), 0.0)
    grid_map = with_stairs(grid_map, (2.0, 3.0), (1.2, 2.0), 0.36, 3)
    grid_map = with_ramp(grid_map, (0.5, -3.0), (2.0, 1.0), 0.3)
    grid_map = with_box(grid_map, (2.0, -1.5), (0.6, 0.6), 0.4)
    return with_box(grid_map, (-3.0, 2.0), (0.8, 0.4), 0.25, yaw=0.5)


def pose(x, y, z=HEIGHT, roll=0.0, pitch=0.0, yaw=0.0):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    matrix[:3, 3] = x, y, z
    return matrix


def mapper(**parameters):
    geometry = GridGeometry((10.0, 10.0), RESOLUTION)
    return ElevationMapper(geometry, min_variance=1e-9, max_variance=0.0, **parameters)


def measured(terrain, transform, random, directions=LIDAR):
    return scan(terrain, directions, transform, sensor=LaserModel(), random=random)


def flat(grid_map, layer):
    return grid_map.unwrapped(layer).ravel("F").astype(float)


def truth(terrain, grid_map, margin=0.0):
    """Return mean, smallest and largest height of the terrain in each cell and a margin [m]."""
    offsets = np.linspace(-1.0, 1.0, 11) * (0.499 * grid_map.resolution + margin)
    corners = np.stack(np.meshgrid(offsets, offsets), axis=-1).reshape(-1, 2)
    samples = grid_map.get_positions()[:, None] + corners
    heights = terrain.at_position("elevation", samples, "linear")
    return heights.mean(axis=1), heights.min(axis=1), heights.max(axis=1)


def test_errors_are_within_the_claimed_deviation():
    random = np.random.default_rng(0)
    terrain, made = with_box(ground(), (1.5, 0.5), (0.3, 3.0), 1.5, yaw=0.4), mapper()
    # The robot walks: it sways, and no ring stays at its place.
    for number, share in enumerate(np.linspace(0.0, 1.0, 30)):
        roll, pitch, bob = random.normal(0.0, [0.04, 0.04, 0.02])
        place = -1.0 + 3.0 * share, -0.5 + 2.0 * share, HEIGHT + bob
        transform = pose(*place, roll, pitch, 0.3 * share)
        points = measured(terrain, transform, random)
        made.update(points, transform, timestamp=number * PERIOD)
    height, variance = (flat(made.grid_map, name) for name in ("elevation", "variance"))
    seen = np.isfinite(height)
    assert seen.mean() > 0.6
    # The height of a cell with an edge in it is a matter of definition. An edge reaches 5 cm: beams
    # err sideways by up to 1.5 cm, edges of `ground` slope, and a beam that hits a wall may come
    # down in the cell before it, which then has the height of the hit.
    low, high = truth(terrain, made.grid_map, 0.05)[1:]
    even = seen & (high - low < 0.02)
    assert even.sum() > 6000
    errors = (height - truth(terrain, made.grid_map)[0])[even]
    assert np.sqrt(np.mean(errors**2)) < 1.1 * np.sqrt(np.mean(variance[even]))
    # No cell is far off, neither beside the wall nor in its shadow.
    assert np.abs(errors).max() < 0.03


@pytest.mark.parametrize("yaw", [0.0, 0.2, 0.4, 0.8])
def test_visibility_removes_no_standing_wall(yaw):
    random = np.random.default_rng(1)
    terrain = with_box(ground(), (1.5, 0.5), (0.3, 3.0), 1.5, yaw=yaw)
    made = mapper()
    directions = SpinningLidar(lowest=-0.5, highest=0.3, azimuths=360).directions
    _, _, high = truth(terrain, made.grid_map)
    stands = np.zeros(high.shape, np.bool_)
    for number, y in enumerate(np.linspace(-2.5, 2.5, 40)):
        transform = pose(0.0, y)
        points = measured(terrain, transform, random, directions)
        made.update(points, transform, timestamp=number * PERIOD)
        height = flat(made.grid_map, "elevation")
        assert (height[stands] > 0.3).all()
        stands |= (high > 1.0) & (height > 0.3)
    assert stands.sum() > 50
