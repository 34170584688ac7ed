# SPDX-License-Identifier: BSD-3-Clause
"""Benchmark of the traversability chain in the demo; the C++ library was not timed."""

from pathlib import Path

import numpy as np
from terrain import terrain

from grid_map_filters_py import FilterChain

CHAIN = "grid_map_demos_py/config/filters_demo_filter_chain.yaml"


def test_traversability_chain(measure):
    chain = FilterChain.from_yaml(Path(__file__).parent.parent / CHAIN)
    grid_map = terrain(400)
    grid_map["color"] = 0.0
    result = measure("Traversability chain", 400, lambda: chain(grid_map))
    traversability = result["traversability"]
    assert np.isfinite(traversability).all()
    flat_and_even = (result["slope"] < 0.06) & (result["roughness"] < 0.005)
    assert traversability[flat_and_even].min() > 0.9
    steep = (result["slope"] > 0.6) & (result["roughness"] > 0.05)
    assert (traversability[steep] < 0.25).all()
    assert ((traversability >= 0) & (traversability <= 1)).all()
