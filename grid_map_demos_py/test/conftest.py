# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures for the tests of this package."""

from pathlib import Path

import pytest

from grid_map_core_py import GridMap
from grid_map_demos_py.terrain import load_terrain

MODEL = Path(__file__).parents[1] / "data" / "jacksboro_fault_dem.npz"


@pytest.fixture
def terrain() -> GridMap:
    return load_terrain(MODEL)
