# SPDX-License-Identifier: BSD-3-Clause
"""Chains on datasets of xarray; the slope beside Horn's method, which xarray-spatial has."""

import numpy as np
import pytest
from filter_cases import ground

from grid_map_core_py import GridMap
from grid_map_filters_py import FilterChain

pytestmark = pytest.mark.needs("xarray")


def chain(**types) -> FilterChain:
    """Return a chain of filters by the names of their types, with their parameters."""
    steps = [
        {"name": name, "type": f"gridMapFilters/{name}Filter", "params": params}
        for name, params in types.items()
    ]
    return FilterChain.from_config(steps)


def slopes(radius: float) -> FilterChain:
    return chain(Slope={"input_layer": "elevation", "output_layer": "slope", "radius": radius})


@pytest.mark.needs("dask")
def test_chain_on_a_lazy_dataset_equals_that_on_the_map():
    heights = np.cumsum(np.random.default_rng(5).normal(size=(60, 47)), axis=0)
    heights[10:14, 20:23] = np.nan
    grid_map = ground(heights, 0.5)
    steps = chain(
        Inpaint={"input_layer": "elevation", "output_layer": "filled", "radius": 1.0},
        NormalVectors={
            "input_layer": "filled",
            "output_layers_prefix": "normal_",
            "normal_vector_positive_axis": "z",
            "radius": 1.0,
        },
        Slope={"input_layers_prefix": "normal_", "output_layer": "slope"},
    )
    dataset = grid_map.to_xarray()
    at_once = dataset.grid_map.filter(steps)
    assert at_once.grid_map.to_map() == steps(grid_map)
    later = dataset.chunk(x=17, y=13).grid_map.filter(steps, max_hole=12)
    assert later["slope"].chunks == ((17, 17, 17, 9), (13, 13, 13, 8))
    found = later.compute()
    for name in at_once:
        np.testing.assert_allclose(found[name], at_once[name], atol=1e-5, err_msg=name)


def horn(heights, side: float):
    """Return slopes [rad] by the weights 1, 2, 1; slow. B. Horn, Hill shading, 1981."""
    slope = np.full(heights.shape, np.nan)
    for row, column in np.ndindex(heights.shape[0] - 2, heights.shape[1] - 2):
        part = heights[row : row + 3, column : column + 3].astype(np.float64)
        along = (part[2] - part[0]) @ [1, 2, 1] / (8 * side)
        across = (part[:, 2] - part[:, 0]) @ [1, 2, 1] / (8 * side)
        slope[row + 1, column + 1] = np.arctan(np.hypot(along, across))
    return slope


@pytest.mark.parametrize("cells", [0.0, 1.5, 2.5])
def test_slope_of_a_plane_is_that_of_horn(cells):
    grid_map = GridMap((6.0, 5.0), 0.5, layers=["elevation"])
    x, y = grid_map.axes()
    grid_map["elevation"] = 0.3 * x[:, np.newaxis] - 0.2 * y
    slope = slopes(cells * 0.5)(grid_map)["slope"]
    expected = horn(grid_map["elevation"], 0.5)
    inner = np.isfinite(expected)
    np.testing.assert_allclose(slope[inner], expected[inner], atol=1e-6)
