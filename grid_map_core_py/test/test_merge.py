# SPDX-License-Identifier: BSD-3-Clause
"""Growing a map, and adding the data of another one."""

import math
from importlib import import_module

import numpy as np
import pytest
from hypothesis import given, strategies as st

import golden
from grid_map_core_py import GeometryError, GridMap, GridMapError, LayerNotFoundError
from grid_map_core_py.testing import assert_maps_equal, grid_maps


@st.composite
def neighbors(draw, layers=("elevation", "extra")):
    """Draw two maps that lie near each other, often with centers on borders of cells."""
    grid_map, other = draw(grid_maps(max_side=6)), draw(grid_maps(layers, max_side=6))
    other.frame_id = draw(st.sampled_from(["", grid_map.frame_id]))
    quarters = st.integers(-20, 20).map(lambda number: number / 4)
    offset = draw(st.tuples(*[quarters | st.floats(-5, 5)] * 2))
    unit = draw(st.sampled_from([grid_map.resolution, other.resolution]))
    other.position = grid_map.position + np.multiply(offset, unit)
    return grid_map, other


def borders(grid_map):
    return grid_map.position - 0.5 * grid_map.length, grid_map.position + 0.5 * grid_map.length


def covers(grid_map, other):
    (lower, upper), (other_lower, other_upper) = borders(grid_map), borders(other)
    return bool((lower <= other_lower + 1e-9).all() and (upper >= other_upper - 1e-9).all())


def by_position(grid_map, layer):
    """Return the values by lattice coordinates, which growing must not change."""
    positions = grid_map.get_positions()
    values = grid_map[layer][grid_map.get_indices(positions)[0]]
    cells = np.round(positions / grid_map.resolution, 3)
    return {tuple(cell): value for cell, value in zip(cells.tolist(), values, strict=True)}


def assert_grown(grown, before, other):
    """Assert that `grown` is the smallest map on the same lattice that covers both maps."""
    assert covers(grown, before)
    assert covers(grown, other)
    for axis in (0, 1):
        extra = grown.size[axis] - before.size[axis]
        (lower, upper), (other_lower, other_upper) = borders(before), borders(other)
        missing = [lower - other_lower, other_upper - upper]
        needed = [
            math.ceil((m[axis] - 1e-9) / before.resolution) for m in missing if m[axis] > 1e-9
        ]
        assert extra == sum(needed)
    for layer in before:
        values, expected = by_position(grown, layer), by_position(before, layer)
        for cell, value in values.items():
            np.testing.assert_equal(value, expected.pop(cell, np.nan))
        assert not expected
    assert grown.layers == before.layers
    assert grown.basic_layers == before.basic_layers
    assert (grown.frame_id, grown.timestamp) == (before.frame_id, before.timestamp)


def naively_added(grid_map, other, *, overwrite_data, layers):
    """Return `grid_map` with data of `other`, cell by cell."""
    result = grid_map.copy()
    for layer in layers:
        if layer not in result:
            result.add(layer)
        for index in np.ndindex(result.size):
            position = result.get_position(index)
            if not other.is_inside(position):
                continue
            value = other[layer][other.get_index(position)]
            if np.isfinite(value) and (overwrite_data or not np.isfinite(result[layer][index])):
                result[layer][index] = value
    return result


class TestExtendToInclude:
    CASES = golden.load("extend_to_include")["cases"]

    def test_equals_cpp_where_it_covers_the_other_map(self):
        compared = 0
        for case in self.CASES:
            grown, expected = golden.to_map(case["map"]), golden.to_map(case["result"])
            geometry = case["other_geometry"]
            other = GridMap(geometry["length"], geometry["resolution"], geometry["position"])
            grown.extend_to_include(other)
            if covers(expected, other):
                assert_maps_equal(grown, expected)
                assert grown.start_index == expected.start_index
                compared += 1
            else:
                # C++ often omits a part of the other map.
                assert_grown(grown, golden.to_map(case["map"]), other)
        assert (compared, len(self.CASES)) == (9, 24)

    @given(neighbors())
    def test_keeps_every_cell_and_covers_the_other_map(self, maps):
        grid_map, other = maps
        before, other_before = grid_map.copy(), other.copy()
        grid_map.extend_to_include(other)
        assert_grown(grid_map, before, other)
        assert_maps_equal(other, other_before)
        assert other.start_index == other_before.start_index

    def test_map_that_covers_the_other_is_unchanged(self, terrain):
        terrain.start_index = (3, 2)
        layer = terrain["elevation"]
        terrain.extend_to_include(GridMap((8 + 1e-9, 5), 1.0, (0.5, 1e-10)))
        terrain.extend_to_include(GridMap((1, 1), 0.1, (4.0, -2.0)))
        assert terrain["elevation"] is layer
        assert terrain.start_index == (3, 2)

    @pytest.mark.parametrize("cells", [0, 3, 41])
    def test_rounding_far_from_origin_adds_no_cell(self, cells):
        for origin in np.random.default_rng(1).uniform(4e6, 6e6, (50, 2)):
            grid_map = GridMap((4, 3), 0.1, origin, layers=["a"])
            grid_map.extend_to_include(GridMap((4, 3), 0.1, origin + 0.1 * cells))
            assert grid_map.size == (40 + cells, 30 + cells)


class TestAddDataFrom:
    CASES = golden.load("add_data_from")["cases"]

    def test_equals_cpp_where_it_is_right(self):
        compared = 0
        for case in self.CASES:
            result, other = golden.to_map(case["map"]), golden.to_map(case["other"])
            expected = golden.to_map(case["result"])
            options = {key: case[key] for key in ("extend_map", "overwrite_data")}
            layers = None if case["copy_all_layers"] else case["layers"]
            result.add_data_from(other, **options, layers=layers)
            # C++ decides by the basic layers which cells to overwrite, and grows as in the class
            # above.
            overwrites = not case["overwrite_data"] and not case["map"]["basic_layers"]
            if overwrites or (case["extend_map"] and not covers(expected, other)):
                grown = golden.to_map(case["map"])
                if case["extend_map"]:
                    grown.extend_to_include(other)
                assert case["copy_all_layers"]
                expected = naively_added(
                    grown, other, overwrite_data=case["overwrite_data"], layers=other.layers
                )
            else:
                assert result.start_index == expected.start_index
                compared += 1
            assert_maps_equal(result, expected)
        assert (compared, len(self.CASES)) == (33, 72)

    @given(neighbors(), st.booleans(), st.booleans(), st.booleans())
    def test_equals_a_loop_over_all_cells(self, maps, extend, overwrite, every_layer):
        grid_map, other = maps
        layers = other.layers if every_layer else ("extra",)
        grown, other_before = grid_map.copy(), other.copy()
        if extend:
            grown.extend_to_include(other)
        expected = naively_added(grown, other, overwrite_data=overwrite, layers=layers)
        grid_map.add_data_from(
            other,
            extend_map=extend,
            overwrite_data=overwrite,
            layers=None if every_layer else (name for name in layers),
        )
        assert_maps_equal(grid_map, expected)
        assert grid_map.start_index == grown.start_index
        assert_maps_equal(other, other_before)
        assert all(data.flags.f_contiguous for data in map(grid_map.__getitem__, grid_map))

    @given(grid_maps(("a", "b")), st.booleans(), st.booleans())
    def test_adding_a_map_to_itself_changes_nothing(self, grid_map, extend, overwrite):
        before = grid_map.copy()
        grid_map.add_data_from(grid_map, extend_map=extend, overwrite_data=overwrite)
        assert_maps_equal(grid_map, before)
        assert grid_map.start_index == before.start_index

    def test_validity_is_judged_layer_by_layer(self):
        """Neither a valid basic layer protects the others, nor the reverse."""
        layers = {"a": [[1], [np.nan], [1]], "b": [[np.nan], [2], [2]]}
        grid_map = GridMap((3, 1), 1.0, layers=layers)
        grid_map.basic_layers = ["a"]
        other = GridMap((3, 1), 1.0, layers={"a": 7, "b": 8})
        grid_map.add_data_from(other, extend_map=False, overwrite_data=False)
        assert grid_map["a"].ravel().tolist() == [1, 7, 1]
        assert grid_map["b"].ravel().tolist() == [8, 2, 2]

    def test_writes_into_the_live_layers_unless_the_map_grows(self, terrain):
        layer = terrain["elevation"]
        other = GridMap((2, 2), 1.0, (0.5, 0.5), {"elevation": -1.0})
        terrain.add_data_from(other, extend_map=True, overwrite_data=True)
        assert terrain["elevation"] is layer
        assert (layer == -1).sum() == 4

    def test_layers_that_are_missing_are_added_even_without_overlap(self, terrain):
        other = GridMap((2, 2), 1.0, (90, 90), {"a": 1.0, "b": 2.0})
        before = terrain.copy()
        terrain.add_data_from(other, extend_map=False, overwrite_data=True, layers="b")
        assert terrain.layers == ("elevation", "variance", "b")
        assert np.isnan(terrain["b"]).all()
        assert_maps_equal(terrain.without_layers("b"), before)

    @pytest.mark.parametrize(
        ("layers", "position", "frame_id", "error", "message"),
        [
            (["a", "b"], (0, 9), "map", LayerNotFoundError, "no layer 'b'; available: a"),
            (["a", 5], (0, 9), "map", LayerNotFoundError, "no layer 5"),
            (5, (0, 9), "map", GridMapError, "expected names of layers, got 5"),
            (None, (0, 9), "odom", GridMapError, "expected a map in frame 'map', got 'odom'"),
            (None, (0, 1e12), "map", GeometryError, r"expected at most 2\*\*31 cells"),
            (None, (0, 1e308), "map", GeometryError, "length"),
        ],
    )
    def test_refused_input_changes_nothing(
        self, terrain, layers, position, frame_id, error, message
    ):
        terrain.start_index = (3, 2)
        before = terrain.copy()
        other = GridMap((2, 2), 1.0, position, {"a": 1.0}, frame_id=frame_id)
        other.crs = "EPSG:25832"
        with pytest.raises(error, match=message):
            terrain.add_data_from(other, extend_map=True, overwrite_data=True, layers=layers)
        assert_maps_equal(terrain, before)
        assert (terrain.start_index, terrain.crs) == ((3, 2), "")

    @pytest.mark.parametrize("other", [None, {"elevation": 1.0}, np.zeros((2, 2))])
    def test_object_other_than_a_map_is_refused(self, terrain, other):
        with pytest.raises(GridMapError, match="other: expected a map"):
            terrain.add_data_from(other, extend_map=False, overwrite_data=True)
        with pytest.raises(GridMapError, match="other: expected a map"):
            terrain.extend_to_include(other)
        with pytest.raises(GridMapError, match="get_transformed_map"):
            terrain.extend_to_include(GridMap((1, 1), 1.0, frame_id="odom"))

    @pytest.mark.needs("pyproj")
    def test_maps_of_different_reference_systems_are_not_merged(self, terrain):
        other = GridMap((1, 1), 1.0, terrain.position, {"b": 7.0})
        for other.crs in (25832, import_module("pyproj").CRS(25832)):
            terrain.add_data_from(other, extend_map=False, overwrite_data=True)
            assert terrain.crs == "EPSG:25832"
        for crs, x in (("EPSG:25833", 0.0), ("EPSG:25832", 5.0)):
            other._reference = crs, (x, 0.0)
            text = rf"with crs 'EPSG:25832', origin \(0.0, 0.0\), got crs '{crs}', origin \({x}"
            with pytest.raises(GridMapError, match=text):
                terrain.extend_to_include(other)
