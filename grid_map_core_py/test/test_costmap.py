# SPDX-License-Identifier: BSD-3-Clause
"""Costs of navigation."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st

import golden
from grid_map_core_py import GeometryError, GridMap, LayerNotFoundError
from grid_map_core_py.conversions import CostRange, CostTable, from_costs, to_costs
from grid_map_core_py.testing import assert_maps_equal, grid_maps

CONVERTERS = golden.load("converters")
TO_COSTMAP = [
    (CONVERTERS["maps"][case["map"]], conversion)
    for case in CONVERTERS["cases"]
    for conversion in case["to_costmap"]
]
FROM_COSTMAP = [conversion for case in CONVERTERS["cases"] for conversion in case["from_costmap"]]
CENTURY, DIRECT = CostTable(), CostTable(0, 253, 254, 255)
ALL_COSTS = np.arange(256, dtype=np.uint8)
TABLES = {
    "century": CENTURY,
    "direct": DIRECT,
    "unknown is NaN": CostTable(0.0, 1.0, 1.5, math.nan),
    "negative": CostTable(free=-7.5, inscribed=-0.25, lethal=3, unknown=-100),
}


def has_range(conversion) -> bool:
    """C++ treats the two bounds as a range even if they are equal."""
    return conversion["data_min"] != conversion["data_max"]


def test_layers_become_the_costs_of_cpp():
    compared = [case for case in TO_COSTMAP if has_range(case[1])]
    assert len(compared) == 12
    for description, case in compared:
        codec = CostRange(case["data_min"], case["data_max"])
        costmap = to_costs(golden.to_map(description), case["layer"], codec)
        expected = case["costmap"]
        assert costmap.costmap.dtype == np.uint8
        assert costmap.costmap.tolist() == expected["data"]
        assert (costmap.size_x, costmap.size_y) == (expected["size_x"], expected["size_y"])
        assert costmap.resolution == pytest.approx(expected["resolution"], rel=1e-7)
        origin = [costmap.origin_x, costmap.origin_y, 0]
        assert origin == pytest.approx(expected["origin"]["position"], abs=1e-9)
        assert costmap.global_frame_id == expected["header"]["frame_id"]


def test_costs_become_the_layers_of_cpp():
    assert len(FROM_COSTMAP) == 16
    for case in FROM_COSTMAP:
        given_costmap = case["costmap"]
        origin = given_costmap["origin"]["position"]
        costmap = SimpleNamespace(
            costmap=np.array(given_costmap["data"], dtype=np.uint8),
            size_x=given_costmap["size_x"],
            size_y=given_costmap["size_y"],
            resolution=given_costmap["resolution"],
            origin_x=origin[0],
            origin_y=origin[1],
            global_frame_id=given_costmap["header"]["frame_id"],
        )
        timestamp = case["result"]["timestamp"]
        result = from_costs(costmap, "cost", CostRange(), timestamp=timestamp)
        assert_maps_equal(result, golden.to_map(case["result"]))


def test_the_century_is_the_scale_of_occupancy_grids():
    np.testing.assert_array_equal(CENTURY.to_values([0, 253, 254, 255]), [0, 99, 100, -1])
    values = CENTURY.to_values(ALL_COSTS)
    assert values.dtype == np.float32
    for cost in range(253):
        assert values[cost] == pytest.approx(99 * cost / 253, rel=1e-6)


def test_direct_values_are_the_costs():
    assert DIRECT.to_values(ALL_COSTS).tolist() == ALL_COSTS.tolist()


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_every_cost_survives_the_way_through_a_layer(table):
    assert table.to_costs(table.to_values(ALL_COSTS)).tolist() == ALL_COSTS.tolist()


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_a_value_becomes_the_nearest_cost(table):
    values = table.to_values(ALL_COSTS[:255]).astype(np.float64)
    queries = np.random.default_rng(1).uniform(values[0] - 1, values[-1] + 1, 2000)
    nearest = np.abs(queries[:, None] - values).argmin(axis=1)
    # Halfway between two costs, rounding decides.
    distances = np.abs(queries[:, None] - values)
    costs = table.to_costs(queries)
    rows = np.arange(queries.size)
    np.testing.assert_allclose(distances[rows, costs], distances[rows, nearest], atol=1e-5)


@pytest.mark.parametrize("codec", [*TABLES.values(), CostRange(0, 1), CostRange(5, -5)])
def test_nan_never_becomes_free(codec):
    assert codec.to_costs([np.nan, -np.nan]).tolist() == [255, 255]
    assert codec.to_costs(np.full((3, 4), np.nan)).tolist() == [[255] * 4] * 3
    assert codec.to_costs(np.nan) == 255


def test_values_outside_the_scale_are_free_or_lethal():
    assert CENTURY.to_costs([-2, -0.5, 99.4, 99.6, 1e9]).tolist() == [0, 0, 253, 254, 254]
    assert CENTURY.to_costs([-np.inf, np.inf]).tolist() == [0, 254]
    costs = CostRange(-1, 1).to_costs([-np.inf, -2, -1, 0, 1, 2, np.inf])
    assert costs.tolist() == [0, 0, 0, 127, 254, 254, 254]
    assert CostRange(1, -1).to_costs([-np.inf, -1, 1, np.inf]).tolist() == [254, 254, 0, 0]


@given(
    st.floats(-100, 100, width=32),
    st.floats(-100, 100, width=32).filter(lambda extent: abs(extent) > 0.01),
)
def test_costs_of_a_range_survive_within_one(low, extent):
    codec = CostRange(low, low + extent)
    again = codec.to_costs(codec.to_values(ALL_COSTS)).astype(int)
    assert again[255] == 255
    assert np.abs(again - ALL_COSTS).max() <= 1


@pytest.mark.parametrize("shape", [(), (0,), (7,), (3, 4), (2, 3, 4)])
@pytest.mark.parametrize("codec", [CENTURY, CostRange(0, 100)])
def test_arrays_keep_their_shape(codec, shape):
    values = np.full(shape, 50.0)
    assert codec.to_costs(values).shape == shape
    assert codec.to_costs(values).dtype == np.uint8
    costs = np.full(shape, 7)
    assert codec.to_values(costs).shape == shape
    assert codec.to_values(costs).dtype == np.float32


@given(grid_maps())
def test_moved_maps_give_the_costmap_of_the_same_world(grid_map):
    costmap = to_costs(grid_map, "elevation", CENTURY)
    standing = grid_map.copy()
    standing.convert_to_default_start_index()
    expected = to_costs(standing, "elevation", CENTURY)
    np.testing.assert_array_equal(costmap.costmap, expected.costmap)
    result = from_costs(costmap, "cost", DIRECT, timestamp=grid_map.timestamp)
    expected_values = CENTURY.to_costs(standing["elevation"])
    np.testing.assert_array_equal(result["cost"], expected_values)
    np.testing.assert_allclose(result.position, grid_map.position, atol=1e-9)
    assert (result.size, result.frame_id) == (grid_map.size, grid_map.frame_id)


@pytest.mark.parametrize(
    ("codec", "values", "message"),
    [
        (CostTable, (0, 0, 100, -1), "free < inscribed < lethal"),
        (CostTable, (0, 99, 50, -1), "free < inscribed < lethal"),
        (CostTable, (0, 99, math.inf, -1), "free < inscribed < lethal"),
        (CostTable, (math.nan, 99, 100, -1), "free < inscribed < lethal"),
        (CostTable, (0, None, 100, -1), "inscribed: expected a number, got None"),
        (CostTable, (0, 99, 100, 0), "unknown: expected a value that no known cost has, got 0"),
        *(
            (CostRange, bounds, "two different finite float32 numbers")
            for bounds in [(0.1, 0.1), (0, math.inf), (math.nan, 1), (0, 1e-60)]
        ),
        (CostRange, (0, "high"), "data_max: expected a number, got 'high'"),
    ],
)
def test_invalid_codec_is_refused(codec, values, message):
    with pytest.raises(GeometryError, match=message):
        codec(*values)


@pytest.mark.parametrize("costs", [[-1], [256], [0.5], "free", None])
def test_costs_are_bytes(costs):
    for codec in (CENTURY, CostRange()):
        with pytest.raises(GeometryError, match="costs: expected"):
            codec.to_values(costs)


@pytest.mark.parametrize(
    ("attribute", "value", "message"),
    [
        ("size_x", 4, r"expected 4 x 2 costs, got \(6,\)"),
        ("size_x", 2.5, "size_x, size_y: expected integers"),
        ("resolution", "fine", "resolution: expected a number, got 'fine'"),
        ("resolution", 0.0, "resolution: expected a positive number"),
        ("origin_x", math.nan, "origin_x, origin_y: expected two finite numbers"),
    ],
)
def test_invalid_costmap_is_refused(attribute, value, message):
    costmap = to_costs(GridMap((3, 2), 1.0, layers={"cost": 0.0}), "cost", DIRECT)
    with pytest.raises(GeometryError, match=message):
        from_costs(SimpleNamespace(**{**vars(costmap), attribute: value}), "cost", DIRECT)
    with pytest.raises(LayerNotFoundError, match="no layer 'height'"):
        to_costs(GridMap((3, 2), 1.0, layers={"cost": 0.0}), "height", DIRECT)
