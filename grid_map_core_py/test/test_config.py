# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Dataclasses from parameters."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pytest

from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import build, cast, describe


@dataclass(frozen=True, kw_only=True)
class Example:
    radius: float
    name: str = "name"
    count: int = 3
    flag: bool = False
    mode: Literal["area", "raster"] = "area"
    layers: tuple[str, ...] = ()
    weights: list[float] = field(default_factory=list)
    limit: float | None = None


def test_yaml_numbers_are_cast_to_the_type_of_the_field():
    example = build(Example, {"radius": 1, "count": 5.0, "layers": ["a", "b"], "limit": 2})
    assert example == Example(radius=1.0, count=5, layers=("a", "b"), limit=2.0)
    assert isinstance(example.radius, float)
    assert isinstance(example.count, int)
    assert isinstance(example.limit, float)
    assert build(Example, {"radius": 1.0, "limit": None}).limit is None


def test_numpy_numbers_are_accepted():
    assert cast("x", np.float32(0.5), float) == 0.5
    assert cast("x", np.int64(3), float) == 3.0
    assert type(cast("x", np.int64(3), int)) is int
    assert type(cast("x", np.float64(3.0), int)) is int
    with pytest.raises(ConfigError, match="expected a number"):
        cast("x", np.True_, float)


def test_error_of_boolean_for_text_suggests_quotes():
    with pytest.raises(ConfigError, match=r"expected one of 'x', 'y' \(quote it\), got True"):
        cast("axis", True, Literal["x", "y"])


@pytest.mark.parametrize("empty", [None, [], ()])
def test_empty_list_may_have_no_type(empty):
    example = build(Example, {"radius": 1.0, "layers": empty, "weights": empty})
    assert example.layers == ()
    assert example.weights == []


@pytest.mark.parametrize("given", [[1, 2.5], (1, 2.5)])
def test_lists_and_tuples_are_cast_item_by_item(given):
    assert cast("weights", given, list[float]) == [1.0, 2.5]
    assert cast("weights", given, tuple[float, ...]) == (1.0, 2.5)
    assert all(isinstance(item, float) for item in cast("weights", given, list[float]))


def test_given_list_is_copied():
    given = [1.0]
    assert cast("weights", given, list[float]) is not given


def test_types_are_described_in_words():
    assert describe(list[float]) == "a list, each item a number"
    assert describe(tuple[str, ...]) == "a list, each item a string"
    assert describe(int | None) == "an integer or nothing"


@pytest.mark.parametrize("text", ["", "map", "1"])
def test_string_is_never_converted_to_another_type(text):
    assert cast("frame_id", text, str) == text
    for hint in (int, float, bool, list[str]):
        with pytest.raises(ConfigError, match="parameter 'frame_id': expected "):
            cast("frame_id", text, hint)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({}, "missing parameter 'radius'"),
        (
            {"radius": 1, "radus": 2},
            (
                "unknown parameter 'radus'; "
                "known: radius, name, count, flag, mode, layers, weights, limit"
            ),
        ),
        ({"radius": "1"}, "parameter 'radius': expected a number, got '1' (str)"),
        ({"radius": True}, "parameter 'radius': expected a number, got True (bool)"),
        ({"radius": 1, "count": 1.5}, "parameter 'count': expected an integer, got 1.5 (float)"),
        ({"radius": 1, "count": True}, "parameter 'count': expected an integer, got True (bool)"),
        (
            {"radius": 1, "count": float("nan")},
            "parameter 'count': expected an integer, got nan (float)",
        ),
        (
            {"radius": 1, "name": 3},
            "parameter 'name': expected a string (quote it), got 3 (int)",
        ),
        (
            {"radius": 1, "name": True},
            "parameter 'name': expected a string (quote it), got True (bool)",
        ),
        ({"radius": 1, "name": None}, "parameter 'name': expected a string, got nothing"),
        ({"radius": None}, "parameter 'radius': expected a number, got nothing"),
        ({"radius": 1, "flag": 1}, "parameter 'flag': expected true or false, got 1 (int)"),
        (
            {"radius": 1, "mode": "rastr"},
            "parameter 'mode': expected one of 'area', 'raster', got 'rastr' (str)",
        ),
        (
            {"radius": 1, "layers": "a"},
            "parameter 'layers': expected a list, each item a string, got 'a' (str)",
        ),
        (
            {"radius": 1, "layers": ["a", 1]},
            "parameter 'layers': expected a list, each item a string, got ['a', 1] (list)",
        ),
        (
            {"radius": 1, "weights": [1, True]},
            "parameter 'weights': expected a list, each item a number, got [1, True] (list)",
        ),
        (
            {"radius": 1, "weights": [[1.0]]},
            "parameter 'weights': expected a list, each item a number, got [[1.0]] (list)",
        ),
        (
            {"radius": 1, "limit": "low"},
            "parameter 'limit': expected a number or nothing, got 'low' (str)",
        ),
    ],
)
def test_mismatch_names_expected_and_actual_value(parameters, message):
    with pytest.raises(ConfigError) as caught:
        build(Example, parameters)
    assert str(caught.value) == message
