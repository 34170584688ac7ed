# SPDX-License-Identifier: BSD-3-Clause
"""Changes of resolution."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, strategies as st

import golden
from grid_map_core_py import GeometryError, GridMap, Interpolation, color_vector_to_value
from grid_map_core_py.conversions import change_resolution
from grid_map_core_py.testing import assert_maps_equal, grid_maps

GOLDEN = golden.load("cv_change_resolution")
CASES = [(GOLDEN["maps"][case["map"]], case) for case in GOLDEN["cases"]]
FLAGS = {
    "nearest": cv2.INTER_NEAREST,
    "linear": cv2.INTER_LINEAR,
    "cubic": cv2.INTER_CUBIC,
    "area": cv2.INTER_AREA,
    "lanczos": cv2.INTER_LANCZOS4,
    "linear exact": cv2.INTER_LINEAR_EXACT,
    "nearest exact": cv2.INTER_NEAREST_EXACT,
}
INTERPOLATIONS = pytest.mark.parametrize("flag", FLAGS.values(), ids=FLAGS)
RESOLUTIONS = [0.1, 0.05, 0.025, 0.07, 0.033, 0.31, 0.6]


def to_map(description, case) -> GridMap:
    return golden.to_map({**description, "layer_order": case["layers"]})


def converted(description, case) -> GridMap:
    grid_map = to_map(description, case)
    return change_resolution(grid_map, case["resolution"], case["cv_interpolation"])


def terrain(rows: int, columns: int, holes: float = 0.0) -> GridMap:
    x, y = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    values = np.sin(0.3 * x) + np.cos(0.2 * y) + 0.01 * x * y
    values[np.random.default_rng(8).random(values.shape) < holes] = np.nan
    grid_map = GridMap((0.05 * rows, 0.05 * columns), 0.05, (1, 2), {"elevation": values})
    grid_map.frame_id, grid_map.timestamp = "map", 5
    return grid_map


# --- against C++ ----------------------------------------------------------------------------------


def rounds_half_down(description, case) -> bool:
    """C++ rounds half a cell to an even number."""
    sizes = np.multiply(description["size"], description["resolution"]) / case["resolution"]
    return bool((np.isclose(sizes % 1, 0.5) & (np.floor(sizes) % 2 == 0)).any())


def test_grids_equal_cpp_except_for_half_a_cell():
    """Half a cell is rounded away from zero; C++ rounds it to an even number."""
    compared = 0
    for description, case in CASES:
        result, expected = converted(description, case), golden.to_map(case["result"])
        if rounds_half_down(description, case):
            assert (result.size, expected.size) == ((8, 7), (8, 6))
            continue
        assert result.size == expected.size
        assert (result.frame_id, result.timestamp) == (expected.frame_id, expected.timestamp)
        assert (result.layers, result.start_index) == (expected.layers, (0, 0))
        np.testing.assert_allclose(result.position, expected.position)
        np.testing.assert_allclose(result.length, expected.length)
        compared += 1
    assert (compared, len(CASES)) == (15, 18)


@pytest.mark.parametrize(("layer", "least"), [("full", 13_000), ("elevation", 5000)])
def test_layers_equal_cpp_away_from_holes(layer, least):
    """C++ has 16 bits, and replaces holes by the lowest value: wrong within the kernel."""
    count = 0
    for description, case in CASES:
        expected = golden.matrix(case["result"]["layers"][layer])
        rows, columns = expected.shape
        clean = np.ones(expected.shape, dtype=bool)
        if case["cv_interpolation"] != cv2.INTER_NEAREST:
            clean = ~near_holes(description, case, layer)[:rows, :columns]
        # An integer cannot overshoot the range.
        source = golden.matrix(description["layers"][layer])
        values = converted(description, case)[layer][:rows, :columns]
        values = np.clip(values, np.nanmin(source), np.nanmax(source))
        step = float(np.nanmax(source) - np.nanmin(source)) / 65535
        np.testing.assert_allclose(values[clean], expected[clean], atol=2 * step)
        count += np.count_nonzero(clean)
    assert count > least


def near_holes(description, case, layer) -> np.ndarray:
    grid_map = to_map(description, case)
    source = np.isnan(grid_map.unwrapped(layer))
    ratio = case["resolution"] / description["resolution"]
    sizes = [math.floor(cells / ratio + 0.5 + 1e-9) for cells in source.shape]
    touched = np.zeros(sizes, dtype=bool)
    for row, column in np.ndindex(*sizes):
        center = (np.array([row, column]) + 0.5) * ratio - 0.5
        touched[row, column] = source[kernel(center)].any()
    return touched


def kernel(center: np.ndarray) -> tuple[slice, slice]:
    """Return the cells of the 4 x 4 block around a place that are on the map."""
    rows, columns = (
        slice(max(first - 1, 0), first + 3) for first in np.floor(center).astype(int).tolist()
    )
    return rows, columns


# --- properties ---------------------------------------------------------------------------------


@pytest.mark.parametrize("flag", [f for name, f in FLAGS.items() if "nearest" not in name])
@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_a_cell_is_missing_where_its_nearest_cell_is(flag, resolution):
    grid_map = terrain(24, 31, holes=0.3)
    missing = np.isnan(grid_map["elevation"])
    found = np.isnan(change_resolution(grid_map, resolution, flag)["elevation"])
    for row, column in np.ndindex(*found.shape):
        center = (np.array([row, column]) + 0.5) * resolution / 0.05 - 0.5
        # Halfway between two cells, either one may be the nearest.
        candidates = {
            tuple(np.clip(np.rint(center + nudge).astype(int), 0, (23, 30)))
            for nudge in (-1e-6, 1e-6)
        }
        assert found[row, column] in {missing[cell] for cell in candidates}


@INTERPOLATIONS
@pytest.mark.parametrize("resolution", RESOLUTIONS)
def test_holes_do_not_bleed(flag, resolution):
    grid_map = terrain(24, 31, holes=0.3)
    known = np.isfinite(grid_map["elevation"])
    grid_map["level"] = np.where(known, 1e3, np.nan)
    grid_map["infinite"] = np.where(known, 1e3, np.inf)
    result = change_resolution(grid_map, resolution, flag)
    level = result["level"]
    np.testing.assert_allclose(level[np.isfinite(level)], 1e3, rtol=1e-5)
    # Infinities do not spread.
    np.testing.assert_array_equal(result["infinite"] == np.inf, np.isnan(level))
    infinite = result["infinite"]
    np.testing.assert_allclose(infinite[np.isfinite(infinite)], 1e3, rtol=1e-5)


@INTERPOLATIONS
@given(
    grid_map=grid_maps(max_side=9),
    resolution=st.sampled_from([0.013, 0.03, 0.05, 0.1, 0.21, 0.4, 1.0, 1.7]),
)
def test_moved_maps_give_equal_results_and_stay_unchanged(flag, grid_map, resolution):
    cells = np.multiply(grid_map.size, grid_map.resolution) / resolution
    if cells.min() < 0.5 or cells.max() > 300:
        return
    before = grid_map.copy()
    result = change_resolution(grid_map, resolution, flag)
    assert_maps_equal(grid_map, before)
    grid_map.convert_to_default_start_index()
    assert_maps_equal(change_resolution(grid_map, resolution, flag), result)
    assert result.basic_layers == grid_map.basic_layers
    assert (result.frame_id, result.timestamp) == (grid_map.frame_id, grid_map.timestamp)
    np.testing.assert_array_equal(result.position, grid_map.position)
    if cells.min() > 0.51:
        expected = np.floor(cells + 0.5 + 1e-9)
        assert result.size == tuple(expected.astype(int))
    finite = grid_map["elevation"][np.isfinite(grid_map["elevation"])]
    found = result["elevation"][np.isfinite(result["elevation"])]
    if found.size:
        # The weights of no kernel overshoot by more than this.
        margin = 1.3 * (finite.max() - finite.min()) + 1e-5 * np.abs(finite).max() + 1e-6
        assert found.min() >= finite.min() - margin
        assert found.max() <= finite.max() + margin


@INTERPOLATIONS
def test_the_same_resolution_changes_nothing(flag):
    grid_map = terrain(7, 12, holes=0.2)
    assert_maps_equal(change_resolution(grid_map, 0.05, flag), grid_map, rtol=1e-6)


def test_one_cell_may_become_many_and_vice_versa():
    one = GridMap((0.2, 0.2), 0.2, layers={"height": 7.0})
    many = change_resolution(one, 0.01, Interpolation.CUBIC)
    np.testing.assert_allclose(many["height"], np.full((20, 20), 7.0), rtol=1e-6)
    again = change_resolution(many, 0.2, "area")
    np.testing.assert_allclose(again["height"], [[7.0]], rtol=1e-6)


def test_layers_without_data_stay_without_data():
    grid_map = terrain(9, 8)
    grid_map["empty"] = np.nan
    grid_map["lonely"] = np.nan
    grid_map["lonely"][4, 4] = 3.5
    grid_map.basic_layers = ["empty"]
    result = change_resolution(grid_map, 0.025)
    assert np.isnan(result["empty"]).all()
    assert np.isfinite(result["lonely"]).sum() == 4
    np.testing.assert_allclose(result["lonely"][8:10, 8:10], 3.5)
    assert result.basic_layers == ("empty",)


def test_colors_are_picked_not_mixed():
    grid_map = GridMap((4, 4), 1.0)
    colors = color_vector_to_value(np.random.default_rng(1).integers(0, 256, (4, 4, 3)))
    grid_map["color"] = colors
    result = change_resolution(grid_map, 0.5)
    np.testing.assert_array_equal(result["color"], colors.repeat(2, axis=0).repeat(2, axis=1))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *(((value,), "resolution: expected a") for value in (0, -1, math.nan, math.inf, "fine")),
        ((0.25,), r"resolution: expected at most twice the length \(0.1"),
        ((0.1, "cubik"), "interpolation: expected one of nearest, linear, cubic, area"),
        ((0.1, 99), "interpolation: OpenCV cannot resize with 99"),
    ],
)
def test_wrong_arguments_are_named(arguments, message):
    with pytest.raises(GeometryError, match=message):
        change_resolution(terrain(2, 4), *arguments)
    assert change_resolution(terrain(4, 4), 0.4).size == (1, 1)
