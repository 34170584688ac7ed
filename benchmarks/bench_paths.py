# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of least-cost paths; C++ has none."""

import math

import numpy as np
import pytest
from terrain import RESOLUTION, heights

from grid_map_core_py import GridMap
from grid_map_core_py.planning import Footprint, SlopeLimits, TravelGraph

OPTIONS = {
    "costs": {"cost": "cost", "lethal": 253},
    "costs, footprint": {
        "cost": "cost",
        "lethal": 253,
        "footprint": Footprint.rectangle(0.45, 0.25),
    },
    "costs, slopes": {
        "cost": "cost",
        "lethal": 253,
        "elevation": "elevation",
        "limits": SlopeLimits(*np.radians((30.0, 35.0, 30.0))),
        "max_step": 0.2,
    },
}


def ground(cells: int) -> tuple[GridMap, np.ndarray, np.ndarray]:
    """Return a map with posts and higher costs around them, a start and a goal."""
    side = cells * RESOLUTION
    grid_map = GridMap((side, side), RESOLUTION, frame_id="map")
    grid_map["elevation"] = heights(grid_map)
    x, y = grid_map.axes()
    from_posts = np.hypot(
        (x % 1.5 - 0.75)[:, None], (y + 0.4 * np.floor(x / 1.5)[:, None]) % 1.5 - 0.75
    )
    grid_map["cost"] = np.where(from_posts < 0.15, 254.0, 200.0 * np.exp(-3.0 * from_posts))
    corner = np.array([0.47, 0.45]) * side
    return grid_map, corner, -corner


def checked(path, start, goal):
    assert math.dist(start, goal) <= path.length < 1.3 * math.dist(start, goal)


@pytest.mark.parametrize("name", OPTIONS)
def test_graph_and_costs_to_every_cell(measure, cells, name):
    grid_map, start, goal = ground(cells)
    plan = lambda: TravelGraph(grid_map, **OPTIONS[name]).cost_to(goal)  # noqa: E731
    field = measure(f"graph and costs to a goal: {name}", cells, plan)
    checked(field.path(start), start, goal)


@pytest.mark.parametrize("name", OPTIONS)
def test_path(measure, cells, name):
    grid_map, start, goal = ground(cells)
    field = TravelGraph(grid_map, **OPTIONS[name]).cost_to(goal)
    checked(measure(f"path: {name}", cells, lambda: field.path(start)), start, goal)
