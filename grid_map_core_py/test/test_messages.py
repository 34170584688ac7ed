# SPDX-License-Identifier: BSD-3-Clause
"""Values in error messages are one short line."""

from types import MappingProxyType

import numpy as np
import pytest

from grid_map_core_py import GeometryError, GridMap, GridMapError, Polygon, circle_cells
from grid_map_core_py._parameters import cast
from grid_map_core_py.errors import short

WORDS = np.full((300, 200), "high")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "None"),
        ("map", "'map'"),
        (1.5, "1.5"),
        (["a", 1], "['a', 1]"),
        ({"a": [1]}, "{'a': [1]}"),
        (np.array([1.0, np.nan]), "array([ 1., nan])"),
        (WORDS, "an array of shape (300, 200) and type <U4"),
    ],
)
def test_short_values_are_shown_and_arrays_described(value, text):
    assert short(value) == text


@pytest.mark.parametrize(
    "value",
    [
        "filters:\n" * 1000,
        list(range(10**6)),
        [[1, 2, [3] * 100] * 50] * 50,
        10**400,
        MappingProxyType({"a": "b" * 1000}),
        Polygon.from_circle((0, 0), 1.0, 5000),
    ],
    ids=lambda value: type(value).__name__,
)
def test_long_values_become_one_line_of_80_characters(value):
    assert len(short(value)) <= 80
    assert "\n" not in short(value)


@pytest.mark.parametrize(
    "call",
    [
        lambda m: m.add("e", WORDS),
        lambda m: m.with_layers(WORDS),
        lambda m: m.get_index(WORDS),
        lambda m: m.at_position("a", (0, 0), WORDS),
        lambda m: m.get_transformed_map(WORDS, "a", "odom"),
        lambda m: m.__setitem__(("e",) * 1000, 1.0),
        lambda m: setattr(m, "frame_id", "\n".join(["map"] * 1000).split()),
        lambda m: circle_cells(m, (0, 0), WORDS),
        lambda _: Polygon(WORDS),
        lambda _: Polygon.from_circle((0, 0), 1.0, 5000).thicken_line(1.0),
        lambda _: GridMap((1, 1), WORDS),
        lambda _: cast("filters", "filters:\n" * 1000, list[float]),
    ],
)
def test_messages_show_no_arrays_and_no_files(call):
    with pytest.raises(GridMapError) as caught:
        call(GridMap((4, 4), 1.0, layers=["a"]))
    assert len(str(caught.value)) < 220
    assert "\n" not in str(caught.value)


def test_transposed_layer_is_told_how_to_turn_it():
    grid_map = GridMap((3, 2), 1.0)
    expected = r"layer 'e': expected shape \(3, 2\), got \(2, 3\)\. Rows run along x: .*values\.T"
    for call in (grid_map.add, grid_map.set_unwrapped):
        with pytest.raises(GeometryError, match=expected):
            call("e", np.zeros((2, 3)))
    with pytest.raises(GeometryError, match=r"got \(3, 3\)$"):
        grid_map["e"] = np.zeros((3, 3))


@pytest.mark.parametrize("value", [1e300, [[0, 1e300]] * 3])
def test_values_beyond_float32_warn_with_the_layer(value):
    grid_map = GridMap((3, 2), 1.0)
    for set_layer in (grid_map.add, grid_map.set_unwrapped):
        with pytest.warns(RuntimeWarning, match="layer 'e': values beyond float32 become infin"):
            set_layer("e", value)
    assert np.isinf(grid_map["e"]).any()


def test_maps_with_long_names_are_shown_in_a_short_line():
    grid_map = GridMap((1.0, 1.0), 0.5, layers=["n" * 10**6, "last"])
    assert len(repr(grid_map)) == 500
