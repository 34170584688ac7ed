# SPDX-License-Identifier: BSD-3-Clause
"""`ElevationMapper` beside a slow oracle, which handles one point and one cell after the other."""

import math

import numpy as np
import pytest
from elevation_oracle import Oracle
from scipy.spatial.transform import Rotation

from grid_map_core_py import GridGeometry
from grid_map_core_py.elevation import (
    ConstantModel,
    ElevationMapper,
    LaserModel,
    PerfectModel,
    StereoModel,
    StructuredLightModel,
    _state,
)

RESOLUTION = 0.25


def diagonal(u, along, across):
    return across**2 * np.eye(3) + (along**2 - across**2) * np.outer(u, u)


def laser(model):
    def spread(p):
        d = float(np.linalg.norm(p))
        return diagonal(p / d, model.min_radius, model.beam_constant + model.beam_angle * d)

    return spread


def light(model):
    def spread(p):
        z = p[2]
        if not model.cutoff_min_depth <= z <= model.cutoff_max_depth:
            return None
        a, b, c, d, e = (getattr(model, f"normal_factor_{letter}") for letter in "abcde")
        along = a + b * (z - c) ** 2 + d * z**e
        return diagonal(np.array([0.0, 0, 1]), along, model.lateral_factor * z)

    return spread


def stereo(model):
    def spread(p):
        if p[2] <= 0:
            return None
        along = p[2] ** 2 / (model.focal_length * model.baseline) * model.disparity_std
        return diagonal(np.array([0.0, 0, 1]), along, model.lateral_factor * p[2])

    return spread


SENSORS = {
    "laser": (LaserModel(), laser),
    "laser of another beam": (LaserModel(min_radius=0.03, beam_constant=0.01), laser),
    "structured light": (StructuredLightModel(normal_factor_d=0.002, normal_factor_e=1.5), light),
    "stereo": (StereoModel(disparity_std=0.3), stereo),
    "perfect": (PerfectModel(), lambda _: lambda _: np.zeros((3, 3))),
    "constant": (
        ConstantModel(sensor_noise_factor=1e-3),
        lambda m: lambda p: m.sensor_noise_factor * float(p @ p),
    ),
}


def pose(x=0.0, y=0.0, z=1.5, roll=0.0, pitch=0.0, yaw=0.0):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    matrix[:3, 3] = x, y, z
    return matrix


def scene(random, count, matrix, step, relief, poles=0.0):
    """Points of the ground, of boxes that come and go, of poles, and of noise, in the sensor frame.

    `poles` is the share of the points on the poles in the cells that have one.
    """
    x, y = random.uniform(-2.2, 2.2, (2, count)) + matrix[:2, 3:4]
    z = relief * np.sin(3 * x) + random.normal(0, 0.01, count)
    on_box = (x > 0.5) & (x < 1.2) & (y > -0.6) & (step % 5 < 2)
    z[on_box] = 0.7 + random.normal(0, 0.01, on_box.sum())
    if poles:
        on_pole = (x % 1.0 < 0.2) & (y % 1.0 < 0.2) & (random.random(count) < poles)
        z[on_pole] = random.uniform(0.0, 1.2, on_pole.sum())
    outlier = random.random(count) < 0.03
    z[outlier] += random.uniform(-1, 1, outlier.sum())
    return (np.stack((x, y, z), axis=1) - matrix[:3, 3]) @ matrix[:3, :3]


def random_covariance(random, scale):
    root = random.normal(size=(6, 6)) * scale
    return root @ root.T


@pytest.fixture
def unrounded(monkeypatch):
    """Heights and variances (2, cells) of each update, before they become float32."""
    found, layers = [], _state.State.layers

    def recorded(state, parameters):
        found.append(np.array((state.heights, state.variances)))
        return layers(state, parameters)

    monkeypatch.setattr(_state.State, "layers", recorded)
    return found


def check_unrounded(numbers, oracle):
    expected = oracle.shaped(oracle.exact, 2).reshape(2, -1, order="F")
    known = np.isfinite(expected[0])
    np.testing.assert_array_equal(np.isfinite(numbers[0]), known)
    np.testing.assert_allclose(numbers[:, known], expected[:, known], rtol=1e-9, atol=1e-12)


def check_layers(mapper, oracle):
    expected = oracle.layers()
    for name, layer in zip(("elevation", "variance", "time"), expected, strict=True):
        found = mapper.grid_map.unwrapped(name)
        np.testing.assert_array_equal(np.isnan(found), np.isnan(layer), name)
        np.testing.assert_allclose(found, layer, rtol=3e-7, atol=2e-7 if name != "variance" else 0)
    reach = 2.486 * np.sqrt(expected[1])
    for name, layer in (("upper_bound", expected[0] + reach), ("lower_bound", expected[0] - reach)):
        np.testing.assert_allclose(mapper.grid_map.unwrapped(name), layer, rtol=1e-6, atol=1e-6)


DRIFT = {"drift_compensation_alpha": 0.3, "min_drift_cells": 20}
CASES = {
    **{name: (name, {}, {}) for name in SENSORS},
    "poles": ("laser", {"min_support": 0.6, "max_ray_length": 1.8}, {"count": 4000, "poles": 0.5}),
    # Only level cells tell drift.
    "drift": ("laser", DRIFT | {"enable_drift_compensation": True}, {"relief": 0.0}),
}


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("case", CASES)
def test_map_equals_oracle(case, unrounded):
    sensor, options, look = CASES[case]
    model, spread_of = SENSORS[sensor]
    random = np.random.default_rng(sum(map(ord, sensor)))
    given = {"time_variance": 1e-5, "scanning_duration": 0.25, "max_ray_length": 4.0}
    given |= {"max_variance": 0.01} | options
    rows, columns = 15, 12
    geometry = GridGeometry.from_size((rows, columns), RESOLUTION, (0.5 * RESOLUTION, 0.0))
    mapper = ElevationMapper(geometry, sensor=model, **given)
    origin = [-(rows - 1) // 2, -columns // 2]
    oracle = Oracle((rows, columns), RESOLUTION, origin, spread_of(model), **given)
    looks_down = sensor in ("structured light", "stereo")
    cleared, conflicts, drifts = 0, 0, 0
    for step in range(12):
        tilt = math.pi if looks_down else 0.0
        matrix = pose(
            0.13 * step, -0.04 * step, 1.5 + 0.004 * step, tilt + 0.05, 0.03 * step, 0.2 * step
        )
        points = scene(random, matrix=matrix, step=step, **{"count": 350, "relief": 0.05} | look)
        points[:3] = [[np.nan, 0, 0], [np.inf, 0, 1], [0, 0, 0]]
        covariance = random_covariance(random, 0.001 * (1 + step)) if step % 4 else None
        target = [round(v / RESOLUTION) for v in (0.13 * step, -0.04 * step)]
        report = mapper.update(
            points,
            matrix,
            timestamp=10**12 + step * 10**8,
            pose_covariance=covariance,
            position=np.array(target) * RESOLUTION + (0.5 * RESOLUTION, 0.0),
        )
        oracle.move(*(origin[k] + target[k] - oracle.origin[k] for k in (0, 1)))
        moved, gone = oracle.update(points, matrix, step * 0.1, covariance)
        assert report.cells_cleared == gone
        assert report.drift == pytest.approx(moved, abs=1e-9)
        check_unrounded(unrounded.pop(), oracle)
        check_layers(mapper, oracle)
        cleared += gone
        conflicts += report.conflicts
        drifts += moved != 0
    assert conflicts == oracle.conflicts > 0
    assert cleared or looks_down
    assert bool(drifts) == (case == "drift")
    assert oracle.risen or case != "poles"
