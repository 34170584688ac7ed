# SPDX-License-Identifier: BSD-3-Clause
"""Dataclasses from parameters."""

from dataclasses import dataclass, field
from typing import Literal

import pytest

from grid_map_core_py._parameters import build
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
    weights = [1, 2.5]
    given = {"radius": 1, "count": 5.0, "layers": ["a", "b"], "limit": 2, "name": "1"}
    example = build(Example, {**given, "weights": weights})
    expected = {"radius": 1.0, "count": 5, "layers": ("a", "b"), "limit": 2.0, "name": "1"}
    assert example == Example(**expected, weights=[1.0, 2.5])
    assert example.weights is not weights
    assert all(isinstance(item, float) for item in example.weights)
    assert isinstance(example.radius, float)
    assert isinstance(example.count, int)
    assert isinstance(example.limit, float)
    assert build(Example, {"radius": 1.0, "limit": None}).limit is None


@pytest.mark.parametrize("empty", [None, [], ()])
def test_empty_list_may_have_no_type(empty):
    example = build(Example, {"radius": 1.0, "layers": empty, "weights": empty})
    assert example.layers == ()
    assert example.weights == []


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
        ("flag", 1, "true or false, got 1 (int)"),
        ("flag", "", "true or false, got '' (str)"),
        ("mode", True, "one of 'area', 'raster' (quote it), got True (bool)"),
        ("mode", "rastr", "one of 'area', 'raster', got 'rastr' (str)"),
        ("layers", "a", "a list, each item a string, got 'a' (str)"),
        ("layers", ["a", 1], "a list, each item a string, got ['a', 1] (list)"),
        ("weights", [1, True], "a list, each item a number, got [1, True] (list)"),
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
