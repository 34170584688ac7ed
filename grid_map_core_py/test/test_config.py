# SPDX-License-Identifier: BSD-3-Clause
"""Dataclasses from parameters."""

from dataclasses import dataclass, field
from typing import Literal

import pytest

from grid_map_core_py._parameters import build, cast
from grid_map_core_py.errors import ConfigError


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
    given = {"radius": 1, "count": 5.0, "layers": ["a", "b"], "limit": 2, "name": "1"}
    example = build(Example, given)
    assert example == Example(radius=1.0, count=5, layers=("a", "b"), limit=2.0, name="1")
    assert isinstance(example.radius, float)
    assert isinstance(example.count, int)
    assert isinstance(example.limit, float)
    assert build(Example, {"radius": 1.0, "limit": None}).limit is None


def test_error_of_boolean_for_text_suggests_quotes():
    with pytest.raises(ConfigError, match=r"expected one of 'x', 'y' \(quote it\), got True"):
        cast("axis", True, Literal["x", "y"])


@pytest.mark.parametrize("empty", [None, [], ()])
def test_empty_list_may_have_no_type(empty):
    example = build(Example, {"radius": 1.0, "layers": empty, "weights": empty})
    assert example.layers == ()
    assert example.weights == []


@pytest.mark.parametrize("given", [[1.0, 2.5], (1, 2.5)])
def test_lists_and_tuples_are_cast_item_by_item(given):
    cast_list = cast("weights", given, list[float])
    assert cast_list == [1.0, 2.5]
    assert cast_list is not given
    assert cast("weights", given, tuple[float, ...]) == (1.0, 2.5)
    assert all(isinstance(item, float) for item in cast_list)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("radius", "1", "a number, got '1' (str)"),
        ("radius", True, "a number, got True (bool)"),
        ("radius", None, "a number, got nothing"),
        ("count", 1.5, "an integer, got 1.5 (float)"),
        ("count", "1", "an integer, got '1' (str)"),
        ("count", True, "an integer, got True (bool)"),
        ("count", float("nan"), "an integer, got nan (float)"),
        ("name", 3, "a string (quote it), got 3 (int)"),
        ("name", True, "a string (quote it), got True (bool)"),
        ("name", None, "a string, got nothing"),
        ("flag", 1, "true or false, got 1 (int)"),
        ("flag", "", "true or false, got '' (str)"),
        ("mode", "rastr", "one of 'area', 'raster', got 'rastr' (str)"),
        ("layers", "a", "a list, each item a string, got 'a' (str)"),
        ("layers", ["a", 1], "a list, each item a string, got ['a', 1] (list)"),
        ("weights", [1, True], "a list, each item a number, got [1, True] (list)"),
        ("weights", [[1.0]], "a list, each item a number, got [[1.0]] (list)"),
        ("limit", "low", "a number or nothing, got 'low' (str)"),
    ],
)
def test_mismatch_names_expected_and_actual_value(name, value, message):
    with pytest.raises(ConfigError) as caught:
        build(Example, {"radius": 1, name: value})
    assert str(caught.value) == f"parameter {name!r}: expected {message}"


def test_missing_and_unknown_parameters_are_named():
    with pytest.raises(ConfigError, match="missing parameter 'radius'"):
        build(Example, {})
    known = "known: radius, name, count, flag, mode, layers, weights, limit"
    with pytest.raises(ConfigError, match=f"unknown parameter 'radus'; {known}"):
        build(Example, {"radius": 1, "radus": 2})
