# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of planar regions: extraction on treads, smeared stairs and rubble, and queries.

The targets on one core, for 100, 200 and 400 cells per side, are 4, 10 and 30 ms for treads, and
15, 45 and 250 ms for smeared stairs and rubble. Single queries should take 0.3 ms, `project` 1 ms
per point, and `convex_inside` 10 ms.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_core_py.planes import convex_inside, extract_planes

sys.path.append(str(Path(__file__).resolve().parents[1] / "grid_map_core_py" / "test"))
from plane_scenes import Rubble, sampled, stairs

SIDES = pytest.mark.parametrize("cells", [100, 200, 400])


def treads(x, y):
    """Return heights of treads of 0.3 x 1 m, each different from its neighbors."""
    return 0.17 * ((np.floor(x / 0.3) + 2 * np.floor(y)) % 7)


def rubble(cells):
    side = 0.04 * cells
    boxes = Rubble(1, side, int(1.5 * side**2))
    return sampled(boxes, (cells, cells), 1, share=1, outliers=0.05)[0]


def smeared(cells):
    grid_map, _ = sampled(stairs(0.17, 0.1), (cells, cells), 1, share=1)
    blurred = cv2.GaussianBlur(np.ascontiguousarray(grid_map["elevation"]), (0, 0), 1.5)
    return GridMap.from_array(blurred, grid_map.resolution)


@SIDES
def test_treads(measure, cells):
    grid_map, _ = sampled(treads, (cells, cells), 1, share=1)
    regions = measure("planes, grid of treads", cells, lambda: extract_planes(grid_map))
    assert len(regions) >= (0.04 * cells // 0.3 - 1) * (0.04 * cells - 1)


@SIDES
@pytest.mark.parametrize("scene", [smeared, rubble])
def test_smeared_stairs_and_rubble(measure, cells, scene):
    grid_map = scene(cells)
    name = f"planes, {scene.__name__}"
    regions = measure(name, cells, lambda: extract_planes(grid_map))
    assert (regions.labels > 0).mean() > 0.4


def test_previous_regions(measure):
    cells = 400
    grid_map, _ = sampled(treads, (cells, cells), 1, share=1)
    first = extract_planes(grid_map)
    again = lambda: extract_planes(grid_map, previous=first)  # noqa: E731
    regions = measure("planes, treads with previous", cells, again)
    assert [region.id for region in regions] == [region.id for region in first]


@pytest.mark.parametrize("query", ["at", "nearest", "project", "convex_inside"])
def test_a_hundred_queries(measure, query):
    cells = 400
    regions = extract_planes(rubble(cells))
    positions = np.random.default_rng(0).uniform(-0.02 * cells, 0.02 * cells, (100, 2))
    on_planes = [position for position in positions if regions.at(position)]
    inside = [(regions.at(position), position) for position in on_planes]
    calls = {
        "at": lambda: [regions.at(position) for position in positions],
        "nearest": lambda: [regions.nearest(position, np.inf) for position in positions],
        "project": lambda: [regions.project([(*position, 0.1)]) for position in positions],
        "convex_inside": lambda: [convex_inside(*pair) for pair in inside],
    }
    found = measure(f"planes, {query}, 100 calls", cells, calls[query])
    assert len(found) == (len(inside) if query == "convex_inside" else 100)
