# SPDX-License-Identifier: BSD-3-Clause
"""Costs for Nav2, compared with recordings of a real Nav2, a slow loop and known terrain."""

import gzip
import json
import math
from pathlib import Path

import filter_oracles as oracles
import numpy as np
import pytest
from filter_cases import TO_OUT, filtered, ground, run, step_of, terrain
from hypothesis import given, settings, strategies as st

from grid_map_core_py.testing import moved_in_buffer
from grid_map_filters_py import FILTERS, FilterConfigError, FilterWarning

RECORDED = json.loads(
    gzip.decompress((Path(__file__).parent / "golden" / "nav2_inflation.json.gz").read_bytes())
)["cases"]
NOT_FINITE = [np.nan, np.inf, -np.inf]


@pytest.mark.parametrize("case", RECORDED, ids=range(len(RECORDED)))
@pytest.mark.parametrize("shift", [(0, 0), (7, 11)])
def test_inflation_equals_recordings_of_nav2(case, shift):
    def layer(name):
        return np.reshape(case[name], (case["height"], case["width"])).T[::-1, ::-1]

    costs = np.select([layer("occupancy") == 100, layer("occupancy") == 0], [254, 0], np.nan)
    grid_map = moved_in_buffer(ground(costs, case["resolution"]), shift)
    # Nav2 replaces the radius of a robot by a polygon with 16 corners.
    angles = np.arange(16) * math.pi / 8
    footprint = case["inscribed"] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for robot in ({"footprint": footprint.tolist()}, {"footprint": str(footprint.tolist())}):
        result = FILTERS["Inflation"](
            input_layer="elevation",
            output_layer="out",
            inflation_radius=case["inflation"],
            cost_scaling_factor=case["scaling"],
            inflate_unknown=case["inflate_unknown"],
            inflate_around_unknown=case["around"],
            **robot,
        )(grid_map)
        assert result.start_index == grid_map.start_index
        expected = np.where(layer("cost") == 255, np.nan, layer("cost").astype(float))
        np.testing.assert_array_equal(result.unwrapped("out"), expected)


@st.composite
def inflations(draw):
    """Draw a map of costs, often moved, and the parameters of its inflation."""
    size = draw(st.tuples(st.integers(1, 16), st.integers(1, 16)))
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    known = draw(st.sampled_from([0.0, 0.7, 1.0]))
    costs = random.choice([0, 0, 0, 1, 100, 252, 253, 254], size).astype(float)
    costs[random.random(size) < draw(st.sampled_from([0.0, 0.9]))] = 0
    costs[random.random(size) >= known] = random.choice(NOT_FINITE)
    resolution = draw(st.sampled_from([0.05, 0.1, 0.3]))
    inscribed, beyond = random.choice([0.0, 0.12, 0.3], 2)
    params = {
        "inscribed_radius": float(inscribed),
        "inflation_radius": float(inscribed + random.choice([beyond, 5.0])),
        "cost_scaling_factor": float(random.choice([0.0, 3.0, 10.0])),
        "inflate_unknown": draw(st.booleans()),
        "inflate_around_unknown": draw(st.booleans()),
    }
    return moved_in_buffer(ground(costs, resolution), np.minimum((3, 5), size) - 1), params


@given(inflations())
@settings(max_examples=50)
def test_inflation_equals_loop_over_lethal_cells(drawn):
    grid_map, params = drawn
    found = run("Inflation", grid_map, **TO_OUT, **params).unwrapped("out")
    radius, inscribed, scaling = (
        params[name] for name in ("inflation_radius", "inscribed_radius", "cost_scaling_factor")
    )
    expected = oracles.inflation(
        grid_map.unwrapped("elevation"),
        *(grid_map.resolution, inscribed, radius, scaling),
        unknown=params["inflate_unknown"],
        around=params["inflate_around_unknown"],
    )
    np.testing.assert_array_equal(found, expected)
    assert found.dtype == np.float32


def test_radii_have_no_tolerance():
    # As 3 * 0.1 > 0.3, the cost is floor(252 * 0.9999), and 0.1 * 3 / 0.1 takes four cells.
    lethal = ground([[254.0] + 5 * [0.0]])
    params = {"inscribed_radius": 0.3, "inflation_radius": 0.1 * 3}
    assert filtered("Inflation", lethal, **params)[0, :4].tolist() == [254, 253, 253, 251]
    assert [
        step_of("Inflation", **TO_OUT, inscribed_radius=0.1, inflation_radius=radius).reach(0.1)
        for radius in (0.3, 0.1 * 3, 0.29, 0.0, 1e300)
    ] == [3, 4, 3, 0, 2**31]


@pytest.mark.parametrize(
    ("footprint", "inscribed"),
    [
        ("[[0.5, 0.2], [0.5, -0.2], [-0.3, -0.2], [-0.3, 0.2]]", 0.2),
        # The nearest point is a corner that occurs twice.
        ([[0.5, 0.5], [-0.3, 0.5], [-0.1, 0.0], [-0.1, 0.0], [-0.3, -0.5], [0.5, -0.5]], 0.1),
    ],
)
def test_footprint_stands_for_its_inscribed_circle(footprint, inscribed):
    costs = ground([[254.0] + 30 * [0.0]], 0.01)
    found = filtered("Inflation", costs, footprint=footprint)[0]
    assert (found == 253).sum() == pytest.approx(inscribed / 0.01, abs=1)


def test_inflation_warns_about_inscribed_cells_beyond_its_radius():
    with pytest.warns(FilterWarning, match=r"inflation_radius: expected at least .* 0\.4 m, got"):
        FILTERS["Inflation"](
            input_layer="elevation", output_layer="out", inscribed_radius=0.4, inflation_radius=0.2
        )(ground([[254.0, 0.0]]))


VALUES = [1.0, 0.999, 0.9, 0.65, 0.301, 0.299, 0.0, -5.0, 7.0, np.nan, np.inf, -np.inf]


@pytest.mark.parametrize(("unknown", "cost"), [("unknown", None), ("lethal", 254), ("free", 0)])
@pytest.mark.parametrize(("free", "lethal"), [(1.0, 0.3), (0.3, 1.0)])
def test_costs_are_graded_between_free_and_lethal_values(free, lethal, unknown, cost):
    def expected(value):
        share = (float(np.float32(value)) - free) / (lethal - free)
        if not math.isfinite(value):
            return np.nan if cost is None else cost
        return 0 if share <= 0 else 254 if share >= 1 else 1 + math.floor(252 * share)

    params = {"free_value": free, "lethal_value": lethal, "unknown": unknown}
    found = filtered("Cost", ground([VALUES]), **params)
    np.testing.assert_array_equal(found, [[*map(expected, VALUES)]])
    assert found.dtype == np.float32
    assert 253 not in filtered("Cost", ground([np.linspace(0, 1.2, 999)]), **params)


@pytest.mark.parametrize(("free", "lethal"), [(0.1, 0.7), (0.7, 0.1), (0.9, 0.3), (0.3, 0.9)])
def test_values_at_the_limits_are_free_and_lethal(free, lethal):
    found = filtered("Cost", ground([[free, lethal]]), free_value=free, lethal_value=lethal)
    assert found.tolist() == [[0, 254]]


def test_second_criterion_is_lethal_also_where_the_first_is_unknown():
    grid_map = terrain((1, 5), slope=[[0.0, 0.0, 0.1, np.nan, 0.3]])
    grid_map["step"] = [[0.13, 0.125, np.nan, 0.2, np.inf]]
    params = {"input_layer": "slope", "output_layer": "out", "free_value": 0.0, "lethal_value": 0.6}
    found = run("Cost", grid_map, **params, lethal_layer="step", lethal_above=0.125)["out"]
    np.testing.assert_array_equal(found, [[254, 0, 43, 254, 254]])


@pytest.mark.parametrize("limit", [0.1, 0.12, 0.3])
def test_second_criterion_equal_to_its_limit_is_free(limit):
    params = {"free_value": 0.0, "lethal_value": 0.6, "lethal_layer": "step", "lethal_above": limit}
    above = np.nextafter(np.float32(limit), np.float32(1.0))
    grid_map = terrain((1, 2), slope=0.0, step=[[limit, above]])
    found = run("Cost", grid_map, input_layer="slope", output_layer="out", **params)["out"]
    np.testing.assert_array_equal(found, [[0, 254]])


@pytest.mark.parametrize(
    ("type_name", "params", "message"),
    [
        *(
            ("Cost", {"lethal_value": value}, "'lethal_value': expected another number than free")
            for value in (0.0, 1e-60)
        ),
        *(
            (
                "Cost",
                {"lethal_value": value},
                "'lethal_value': expected a finite number in the unit",
            )
            for value in (math.inf, 1e60)
        ),
        ("Cost", {"lethal_value": 1.0, "lethal_above": 1.0}, "both or none of 'lethal_layer'"),
        ("Cost", {"lethal_value": 1.0, "unknown": "nan"}, "'unknown': expected one of 'unknown', "),
        ("Inflation", {}, "exactly one of 'inscribed_radius' and 'footprint'"),
        ("Inflation", {"inscribed_radius": -1}, r"'inscribed_radius': .* a length >= 0 \[m\], got"),
        (
            "Inflation",
            {"inscribed_radius": 1, "cost_scaling_factor": -1},
            r"'cost_scaling_factor': expected a number >= 0 \[1/m\], got -1",
        ),
        *(
            ("Inflation", {"footprint": text}, "'footprint': expected (corners|an outline around)")
            for text in (
                "0.3",
                "",
                "{a: 1}",
                "[[1, 2",
                "[[1, 1], [1, 2], [2, 1]]",
                [[1.0], [2.0, 3.0]],
            )
        ),
    ],
)
def test_wrong_cost_parameters_name_the_unit(type_name, params, message):
    free = {"free_value": 0.0} if type_name == "Cost" else {}
    with pytest.raises(FilterConfigError, match=message):
        filtered(type_name, ground([[0.0]]), **free, **params)
