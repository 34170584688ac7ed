# SPDX-License-Identifier: BSD-3-Clause
"""Normals of two algorithms, compared with the true normals."""

import numpy as np
import pytest
from demos import published

from grid_map_core_py import GridMap
from grid_map_demos_py.normal_filter_comparison_demo_node import (
    SHAPES,
    add_errors,
    default_chain,
    surface_map,
    table,
)

ERRORS = ("directionalErrorArea", "directionalErrorRaster")

# --- surfaces, noise and errors -------------------------------------------------------------------


def normals(grid_map: GridMap, prefix: str) -> np.ndarray:
    return np.stack([grid_map[prefix + axis] for axis in "xyz"], axis=-1)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seconds", [0.0, 1.7e9])
def test_true_normals_match_the_heights(shape, seconds):
    grid_map = surface_map(shape, seconds)
    assert grid_map.size == (125, 200)
    # Rows and columns run towards -x and -y.
    slopes = np.gradient(grid_map["elevation"].astype(float), -grid_map.resolution)
    expected = np.dstack([-slopes[0], -slopes[1], np.ones(grid_map.size)])
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    x, y = (axis.reshape(grid_map.size, order="F") for axis in grid_map.get_positions().T)
    regular = np.hypot(x, y) > 0.3  # The cone has a tip.
    regular[[0, -1], :] = regular[:, [0, -1]] = False
    difference = np.abs(normals(grid_map, "normal_analytic_") - expected)[regular]
    assert difference.max() < 5e-3


def test_error_is_one_minus_the_absolute_cosine():
    grid_map = GridMap((0.3, 0.3), 0.1)
    vectors = {"analytic": (0, 0, 1), "area": (0.6, 0, 0.8), "raster": (0, 0, -1)}
    for name, vector in vectors.items():
        for axis, value in zip("xyz", vector, strict=True):
            grid_map[f"normal_{name}_{axis}"] = value
    add_errors(grid_map)
    assert grid_map["directionalErrorArea"][1, 1] == pytest.approx(0.2)
    assert grid_map["directionalErrorRaster"][1, 1] == 0.0
    assert np.isnan(grid_map["directionalErrorArea"]).sum() == 8


def angles(noise: float) -> dict[tuple[str, ...], float]:
    """Return the mean angles [deg] in the table, by shape and algorithm."""
    title, _, *rows = table(default_chain(), noise, 0.0)
    assert title == f"angle to the true normals, noise {noise:g} m, outliers 0.0%"
    return {tuple(row.split()[:2]): float(row.split()[2]) for row in rows}


def test_area_beats_raster_with_noise_and_both_fit_without():
    without, with_noise = angles(0.0), angles(0.015)
    assert [*without] == [(shape, name) for shape in SHAPES for name in ("area", "raster")]
    assert max(without.values()) < 0.5
    for shape in SHAPES:
        area, raster = with_noise[shape, "area"], with_noise[shape, "raster"]
        assert 1.0 < area < 0.9 * raster < 3.0


# --- the node -------------------------------------------------------------------------------------


def second_map(*pairs: str) -> tuple[GridMap, str]:
    """Return the second map of the demo and its output."""
    demo = "normal_filter_comparison_demo"
    (first, second, *_), text = published(
        demo, *pairs, count=2, until=lambda process: ERRORS[0] in process.text
    )
    assert 0 < first.timestamp < second.timestamp
    return second, text


def test_demo_publishes_a_wave_with_normals_and_their_errors():
    grid_map, text = second_map()
    assert {*grid_map.layers} == {
        *(f"elevation{what}" for what in ("", "_noisy", "_filtered")),
        *(f"normal_{name}_{axis}" for name in ("analytic", "area", "raster") for axis in "xyz"),
        *ERRORS,
        "noise",
    }
    assert 0.0149 < grid_map["noise"].max() <= 0.0150001
    assert -0.0149 > grid_map["noise"].min() >= -0.0150001
    np.testing.assert_allclose(
        grid_map["elevation_noisy"], grid_map["elevation"] + grid_map["noise"], atol=1e-6
    )
    area, raster = (np.nanmean(grid_map[layer]) for layer in ERRORS)
    assert 1e-5 < area < raster < 0.01
    assert "noise 0.015 m, outliers 0.0%" in text
    assert text.count("raster ") == 4


def test_shape_noise_and_outliers_are_parameters():
    given = ("shape:=plane", "noise_on_map:=0.0", "outliers_percentage:=0.02")
    grid_map, text = second_map(*given)
    assert np.isinf(grid_map["elevation_noisy"]).sum() == 500
    x, y = grid_map.get_positions().T
    plane = (0.3 * x + 0.2 * y).reshape(grid_map.size, order="F")
    np.testing.assert_allclose(grid_map["elevation"], plane, atol=1e-6)
    np.testing.assert_allclose(grid_map["elevation_filtered"], plane, atol=0.02)
    assert "noise 0 m, outliers 2.0%" in text
