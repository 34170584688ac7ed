# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Dataclasses from parameters."""

from dataclasses import dataclass
from typing import Literal

import pytest

from grid_map_core_py.config import build
from grid_map_core_py.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class Example:
    radius: float
    name: str = "name"
    count: int = 3
    flag: bool = False
    mode: Literal["area", "raster"] = "area"
    layers: tuple[str, ...] = ()
    limit: float | None = None


def test_yaml_numbers_are_cast_to_the_type_of_the_field():
    example = build(Example, {"radius": 1, "count": 5.0, "layers": ["a", "b"], "limit": 2})
    assert example == Example(radius=1.0, count=5, layers=("a", "b"), limit=2.0)
    assert isinstance(example.radius, float)
    assert isinstance(example.count, int)
    assert isinstance(example.limit, float)
    assert build(Example, {"radius": 1.0, "limit": None}).limit is None


def test_an_empty_list_without_a_type_is_an_empty_tuple():
    assert build(Example, {"radius": 1.0, "layers": None}).layers == ()
    assert build(Example, {"radius": 1.0, "layers": []}).layers == ()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({}, "missing parameter 'radius'"),
        (
            {"radius": 1, "radus": 2},
            "unknown parameter 'radus'; known: radius, name, count, flag, mode, layers, limit",
        ),
        ({"radius": "1"}, "parameter 'radius': expected a number, found '1' (str)"),
        ({"radius": True}, "parameter 'radius': expected a number, found True (bool)"),
        ({"radius": 1, "count": 1.5}, "parameter 'count': expected an integer, found 1.5 (float)"),
        ({"radius": 1, "count": True}, "parameter 'count': expected an integer, found True (bool)"),
        (
            {"radius": 1, "count": float("nan")},
            "parameter 'count': expected an integer, found nan (float)",
        ),
        ({"radius": 1, "name": 3}, "parameter 'name': expected a string, found 3 (int)"),
        ({"radius": 1, "flag": 1}, "parameter 'flag': expected true or false, found 1 (int)"),
        (
            {"radius": 1, "mode": "rastr"},
            "parameter 'mode': expected one of 'area', 'raster', found 'rastr' (str)",
        ),
        (
            {"radius": 1, "layers": "a"},
            "parameter 'layers': expected a list, each item a string, found 'a' (str)",
        ),
        (
            {"radius": 1, "layers": ["a", 1]},
            "parameter 'layers': expected a list, each item a string, found ['a', 1] (list)",
        ),
        (
            {"radius": 1, "limit": "low"},
            "parameter 'limit': expected a number or nothing, found 'low' (str)",
        ),
    ],
)
def test_what_does_not_fit_is_named_with_what_was_expected(parameters, message):
    with pytest.raises(ConfigError) as caught:
        build(Example, parameters)
    assert str(caught.value) == message
