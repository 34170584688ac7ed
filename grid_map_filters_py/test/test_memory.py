# SPDX-License-Identifier: BSD-3-Clause
"""Peak memory of filters beside their input and output."""

import gc
import os
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from filter_cases import TO_OUT, step_of

from grid_map_core_py import GridMap
from grid_map_filters_py import FilterChain, Step

SIDE = 800
# The first two steps only normalize and delete.
CHAIN = FilterChain.from_yaml(Path(__file__).parent / "data" / "traversability.yaml").steps[2:]

OTHERS = [
    ("Bilateral", {"sigma_space": 0.1, "sigma_range": 0.1}),
    ("Curvature", {}),
    ("Dilation", {"radius": 0.5}),
    ("Duplication", {}),
    ("GaussianBlur", {"sigma": 0.2}),
    ("MedianFill", {"fill_hole_radius": 0.2, "fill_mask_layer": "m"}),
    ("MinInRadius", {"radius": 0.5}),
    ("Roughness", {"radius": 0.5}),
    ("Slope", {"radius": 0.25}),
    ("StepHeight", {"radius": 0.1}),
]


@pytest.fixture(scope="module")
def grid_map() -> GridMap:
    random = np.random.default_rng(5)
    heights = np.cumsum(random.normal(size=(SIDE, SIDE)) * 0.01, axis=0)
    heights[random.random(heights.shape) < 0.05] = np.nan
    return GridMap((SIDE * 0.05, SIDE * 0.05), 0.05, layers={"elevation": heights})


def peak_above_result(operation, layer_bytes):
    """Return the peak memory besides the result, and the size of the result [layers]."""
    operation()  # memory that is allocated once is not counted
    gc.collect()
    gc.disable()  # memory must be freed by reference counts, not by garbage collection
    tracemalloc.start()
    try:
        result = operation()
        current, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        gc.enable()
    assert result is not None
    return (peak - current) / layer_bytes, current / layer_bytes


def test_chain_needs_memory_for_less_than_five_layers(grid_map):
    chain = FilterChain(CHAIN)
    above, result = peak_above_result(lambda: chain(grid_map), grid_map["elevation"].nbytes)
    assert above < 5
    # The result holds a copy of its input and the layers that the steps have added.
    assert result == pytest.approx(len(chain(grid_map).layers), abs=0.2)


@pytest.mark.parametrize(
    ("filter_step", "before"),
    [
        *((one, CHAIN[:number]) for number, one in enumerate(CHAIN)),
        *((step_of(type_name, **TO_OUT, **params), ()) for type_name, params in OTHERS),
    ],
    ids=lambda value: value.config.type if isinstance(value, Step) else "",
)
def test_a_filter_needs_memory_for_less_than_five_layers(grid_map, filter_step, before):
    given = FilterChain(before)(grid_map)
    above, _ = peak_above_result(lambda: filter_step.filter(given), given["elevation"].nbytes)
    assert above < 5


NEW_PAGES = """
import resource, sys
import numpy as np
from grid_map_core_py import GridMap
from grid_map_filters_py import FilterChain

chain = FilterChain.from_yaml(sys.argv[1])
heights = np.random.default_rng(1).random((400, 400), np.float32)
grid_map = GridMap((20.0, 20.0), 0.05, layers={"elevation": heights, "color": 0.0})
for _ in range(6):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    chain(grid_map)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_filters_keep_their_temporaries_for_the_next_map():
    path = Path(__file__).parent / "data" / "traversability.yaml"
    command = [sys.executable, "-c", NEW_PAGES, str(path)]
    # Clusters of other tests leave variables that let the C library give memory back.
    environ = {key: value for key, value in os.environ.items() if not key.startswith("MALLOC_")}
    run = subprocess.run(command, env=environ, capture_output=True, check=True, text=True)
    pages = int(run.stdout)
    # A layer has 156 pages; without kept memory, there are more than 2000 new ones.
    assert pages < 156
