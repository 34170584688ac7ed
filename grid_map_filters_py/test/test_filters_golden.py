# SPDX-License-Identifier: BSD-3-Clause
"""Every filter against the numbers of the C++ library."""

import gzip
import json
from functools import cache
from pathlib import Path
from typing import Any

import filter_oracles as oracles
import numpy as np
import pytest
from filter_cases import assert_bytes_near

from grid_map_core_py import GridMap
from grid_map_filters_py import FilterChain, FilterConfigError, FilterError


@cache
def golden() -> Any:
    path = Path(__file__).parent / "golden" / "filters.json.gz"
    with gzip.open(path, "rt") as file:
        return json.load(file)


def chain_of(case) -> FilterChain:
    type_name = f"gridMapFilters/{case['filter']}"
    step = {"name": "under_test", "type": type_name, "params": case["params"]}
    return FilterChain.from_config([step])


def to_map(description) -> GridMap:
    grid_map = GridMap(
        description["length"],
        description["resolution"],
        description["position"],
        {
            name: np.array(description["layers"][name], dtype=np.float32)
            for name in description["layer_order"]
        },
        basic_layers=description["basic_layers"],
        frame_id=description["frame_id"],
        timestamp=description["timestamp"],
    )
    grid_map.start_index = description["start_index"]
    return grid_map


def unwrapped(values, description) -> np.ndarray:
    matrix = np.array(values, dtype=np.float32)
    return np.roll(matrix, np.negative(description["start_index"]), axis=(0, 1))


def is_whole_number_of_cells(case) -> bool:
    """Contract 3: discs are closed, as in the oracles; C++ rounds at the edge."""
    cells = case["params"].get("radius", 0.0) / golden()["maps"][case["map"]]["resolution"]
    return cells > 0 and abs(cells - round(cells)) < 1e-6


def deviates(case) -> str | None:
    """Return the reason for a deliberate deviation, or None."""
    name, params = case["filter"], case["params"]
    moved = golden()["maps"][case["map"]]["start_index"] != [0, 0]
    uses_disc = name in ("MeanInRadiusFilter", "MinInRadiusFilter") or (
        name == "NormalVectorsFilter" and params.get("algorithm", "area") == "area"
    )
    if uses_disc and is_whole_number_of_cells(case):
        return "rim"
    if uses_disc and params["input_layer"] == params.get("output_layer"):
        return "reads what it writes"
    if name == "NormalVectorsFilter" and moved and params.get("radius", 0.0) <= 0:
        return "normals at the seam of the buffer"
    if name == "NormalVectorsFilter" and moved and params["algorithm"] == "raster":
        return "normals at the seam of the buffer"
    if name == "InpaintFilter":
        return "8 bits"
    if name == "MathExpressionFilter" and params["expression"].startswith("meanOfFinites"):
        return "stores a scalar as a 1 x 1 layer"
    if name == "SlidingWindowMathExpressionFilter":
        return deviation_of_windows(params, moved)
    return deviation_of_the_rest(name, params, moved)


def deviation_of_windows(params, moved: bool) -> str | None:
    if params["expression"] == params["input_layer"]:
        return "accepts a matrix"
    if params["edge_handling"] == "crop" and ";" in params["expression"]:
        return None
    if moved:
        return "refuses moved maps"
    if "window_length" in params and params["edge_handling"] == "inside":
        return "windows of one cell begin at (1, 1)"
    return None if params["compute_empty_cells"] else "computes empty cells"


def deviation_of_the_rest(name: str, params, moved: bool) -> str | None:
    if name == "CurvatureFilter" and moved:
        return "refuses moved maps"
    if name == "SetBasicLayersFilter" and "layers" in params:
        return "reads layer alone"
    if name == "ColorMapFilter" and params["max/value"] <= params["min/value"]:
        return "a ramp that does not ascend"
    if name == "ColorFillFilter" and not all(
        0 <= params[channel] <= 1 for channel in ("red", "green", "blue")
    ):
        return "channels spill"
    if name == "ColorBlendingFilter" and params["blend_mode"] == "hard_light":
        return "channels spill" if params["opacity"] > 0 else None
    if name == "MedianFillFilter" and abs(params["fill_hole_radius"] - 0.15) < 1e-9:
        return "0.15 / 0.05 are 2 cells"
    return None


def cases(outcome: str) -> list[Any]:
    return [
        pytest.param(case, id=f"{case['filter']}-{case['map']}-{number}")
        for number, case in enumerate(golden()["cases"])
        if classify(case) == outcome
    ]


def classify(case) -> str:
    if deviates(case) == "a ramp that does not ascend" or case["params"].get("window_size") == 4:
        return "refused"
    if deviates(case) in ("refuses moved maps", "reads layer alone"):
        return "deviates"
    if case.get("configure") is False:
        return "refused"
    if "configure" not in case:
        return "cast"
    if deviates(case) == "accepts a matrix" or case.get("exception") or case["update"] is False:
        return "fails"
    return "deviates" if deviates(case) else "equals"


@pytest.mark.filterwarnings("ignore:.*to (delete|be basic):grid_map_filters_py.FilterWarning")
@pytest.mark.parametrize("case", cases("equals"))
def test_result_equals_cpp(case):
    description = golden()["maps"][case["map"]]
    result = chain_of(case)(to_map(description))
    assert list(result.layers) == case["result"]["layer_order"]
    assert list(result.basic_layers) == case["result"]["basic_layers"]
    normalizes = case["filter"] == "BufferNormalizerFilter"
    assert list(result.start_index) == ([0, 0] if normalizes else description["start_index"])
    for name, values in case["result"]["layers"].items():
        ours, expected = result.unwrapped(name), unwrapped(values, case["result"])
        finite = expected[np.isfinite(expected)]
        tolerance = 1e-5 * (np.ptp(finite) if finite.size else 1.0)
        if name in ("color", "blend"):
            # NaN stays NaN (contract 5); in C++ it becomes -0.0.
            expected[expected.view(np.uint32) == 1 << 31] = np.nan
            np.testing.assert_array_equal(ours.view(np.uint32), expected.view(np.uint32))
        else:
            np.testing.assert_allclose(ours, expected, rtol=1e-6, atol=tolerance)


@pytest.mark.parametrize("case", cases("refused"))
def test_parameters_that_cpp_refuses_are_refused(case):
    missing_layer = case["params"].get("layer") == "nope"
    with pytest.raises(FilterError) as caught:
        chain_of(case)(to_map(golden()["maps"][case["map"]]))
    assert isinstance(caught.value, FilterConfigError) or missing_layer
    assert "filter 1 'under_test'" in str(caught.value)


@pytest.mark.parametrize("case", cases("cast"))
def test_integers_are_accepted_for_floats(case):
    """C++ refuses `radius: 1`; we cast it (contract 8: both must load)."""
    result = chain_of(case)(to_map(golden()["maps"][case["map"]]))
    floats = {**case["params"], "radius": float(case["params"]["radius"])}
    expected = chain_of({**case, "params": floats})(to_map(golden()["maps"][case["map"]]))
    np.testing.assert_array_equal(result["o"], expected["o"])


@pytest.mark.parametrize("case", cases("fails"))
def test_maps_that_cannot_be_filtered_raise(case):
    chain = chain_of(case)
    with pytest.raises(FilterError, match="filter 1 'under_test'"):
        chain(to_map(golden()["maps"][case["map"]]))


def test_every_golden_case_is_tested():
    counts = {name: len(cases(name)) for name in ("equals", "refused", "cast", "fails", "deviates")}
    assert sum(counts.values()) == len(golden()["cases"])
    assert counts["equals"] >= 160
    assert all(counts.values()), counts


@pytest.mark.parametrize("case", cases("deviates"))
def test_deviations_are_the_same_on_moved_maps(case):
    """Results on moved maps equal those on unmoved maps where C++ deviates."""
    description = golden()["maps"][case["map"]]
    moved = to_map(description)
    unmoved = moved.copy()
    unmoved.convert_to_default_start_index()
    chain = chain_of(case)
    result, expected = chain(moved), chain(unmoved)
    for name in expected:
        np.testing.assert_array_equal(result.unwrapped(name), expected[name])


# --- where C++ is wrong: cases of the golden data compared with loops over cells ------------------


def deviating(reason: str, name: str) -> list[Any]:
    return [
        case for case in golden()["cases"] if deviates(case) == reason and case["filter"] == name
    ]


def in_map_order(case, layer: str) -> np.ndarray:
    return to_map(golden()["maps"][case["map"]]).unwrapped(layer)


def result_of(case) -> GridMap:
    return chain_of(case)(to_map(golden()["maps"][case["map"]]))


@pytest.mark.parametrize(
    ("name", "oracle"),
    [("MinInRadiusFilter", oracles.min_in_radius), ("MeanInRadiusFilter", oracles.mean_in_radius)],
)
def test_cells_on_the_rim_belong_to_the_disc(name, oracle):
    cases = deviating("rim", name)
    assert len(cases) >= 8
    for case in cases:
        layer, params = in_map_order(case, case["params"]["input_layer"]), case["params"]
        ours = result_of(case).unwrapped(params["output_layer"])
        expected = oracle(layer, 0.05, params["radius"])
        np.testing.assert_allclose(ours, expected, rtol=1e-6, atol=1e-6)


def test_radius_is_rounded_down_except_for_rounding_errors():
    cases = deviating("0.15 / 0.05 are 2 cells", "MedianFillFilter")
    assert len(cases) == 8
    for case in cases:
        layer, params = in_map_order(case, "elevation"), case["params"]
        opened, mask = oracles.fill_mask(layer, params["num_erode_dilation_iterations"])
        existing = 2 if params["filter_existing_values"] else None
        result = result_of(case)
        np.testing.assert_array_equal(
            result.unwrapped("o"), oracles.median_fill(layer, mask, 3, existing)
        )
        np.testing.assert_array_equal(result.unwrapped("dbg"), opened)
        np.testing.assert_array_equal(result.unwrapped("should_fill"), mask)


def test_curvature_on_a_moved_map():
    cases = deviating("refuses moved maps", "CurvatureFilter")
    assert len(cases) == 4
    for case in cases:
        expected = oracles.curvature(in_map_order(case, "elevation"), 0.05)
        ours = result_of(case).unwrapped(case["params"]["output_layer"])
        np.testing.assert_allclose(ours, expected, atol=1e-5 * np.nanmax(np.abs(expected)))


WINDOWS = "SlidingWindowMathExpressionFilter"


def test_empty_cells_stay_empty_when_asked_for():
    for case in deviating("computes empty cells", WINDOWS):
        expected = unwrapped(case["result"]["layers"]["o"], case["result"])
        expected[np.isnan(in_map_order(case, case["params"]["input_layer"]))] = np.nan
        np.testing.assert_allclose(result_of(case)["o"], expected, atol=1e-5)


def test_windows_of_one_cell_cover_the_whole_map():
    for case in deviating("windows of one cell begin at (1, 1)", WINDOWS):
        layer = in_map_order(case, case["params"]["input_layer"])
        np.testing.assert_array_equal(result_of(case)["o"], layer)


def test_basic_layers_are_read_from_both_parameters():
    for case in deviating("reads layer alone", "SetBasicLayersFilter"):
        assert result_of(case).basic_layers == tuple(case["params"]["layers"])


def test_channels_beyond_their_range_are_clamped():
    for case in deviating("channels spill", "ColorFillFilter"):
        assert case["params"] | {"red": 1.5, "green": -0.45, "blue": 0.3} == case["params"]
        colors = result_of(case)["color"]
        assert {oracles.to_bytes(color) for color in colors.flat} == {(255, 0, 76)}


def test_hard_light_equals_cpp_within_the_range_of_channels():
    cases = deviating("channels spill", "ColorBlendingFilter")
    assert len(cases) == 4
    for case in cases:
        params, spilled = case["params"], 0
        below = in_map_order(case, params["background_layer"])
        above = in_map_order(case, params["foreground_layer"])
        ours = result_of(case).unwrapped("blend")
        cpp = unwrapped(case["result"]["layers"]["blend"], case["result"])
        for cell in np.ndindex(ours.shape):
            pair = below[cell], above[cell]
            if np.isnan(pair).any():
                np.testing.assert_array_equal(ours[cell], cpp[cell])
                continue
            channels = oracles.blend(*pair, params["blend_mode"], params["opacity"])
            if min(channels) > 1e-3 and max(channels) < 255.999:
                assert ours[cell].view(np.uint32) == cpp[cell].view(np.uint32)
            else:
                spilled += 1
                assert_bytes_near(ours[cell], channels)
        assert spilled > 5
