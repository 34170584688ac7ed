# SPDX-License-Identifier: BSD-3-Clause
"""Golden numbers of the C++ library, and their maps."""

import gzip
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grid_map_core_py import GridMap


@cache
def load(family: str) -> Any:
    path = Path(__file__).parent / "golden" / f"{family}.json.gz"
    with gzip.open(path, "rt") as file:
        return json.load(file)


def to_map(description: dict[str, Any]) -> GridMap:
    grid_map = GridMap(
        description["length"],
        description["resolution"],
        description["position"],
        {name: matrix(description["layers"][name]) for name in description["layer_order"]},
        basic_layers=description["basic_layers"],
        frame_id=description["frame_id"],
        timestamp=description["timestamp"],
    )
    assert grid_map.size == tuple(description["size"])
    grid_map.start_index = description["start_index"]
    return grid_map


def matrix(rows: list[list[float]]) -> np.ndarray:
    return np.array(rows, dtype=np.float32)


def cases(family: str) -> list[Any]:
    return [(case["map"], case) for case in load(family)["cases"]]


def by_map(family: str) -> pytest.MarkDecorator:
    """Return a decorator that runs a test for every `name` of a map and its `case`."""
    found = cases(family)
    return pytest.mark.parametrize(("name", "case"), found, ids=[name for name, _ in found])


def map_of(family: str, name: str) -> GridMap:
    return to_map(load(family)["maps"][name])


def pairs(cells: tuple[np.ndarray, np.ndarray]) -> list[list[int]]:
    """Return cells (rows, cols) as [row, column], as the C++ library writes them."""
    return np.stack(cells, axis=-1).tolist()
