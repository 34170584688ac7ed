# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map filter` on maps of any size, compared with the chain on the whole map."""

import json
from pathlib import Path

import numpy as np
import pytest

from grid_map_core_py import GridMap, load
from grid_map_core_py.testing import assert_maps_equal
from grid_map_filters_py import FilterChain

pytestmark = pytest.mark.needs("xarray", "zarr", "distributed")

CHAIN = """
grid_map_filters:
  ros__parameters:
    filters:
      filter1:
        name: fill
        type: gridMapCv/InpaintFilter
        params: {input_layer: elevation, output_layer: filled, radius: 0.3}
      filter2:
        name: mean
        type: gridMapFilters/MeanInRadiusFilter
        params: {input_layer: filled, output_layer: mean, radius: 0.3}
      filter3:
        name: above
        type: gridMapFilters/MathExpressionFilter
        params: {expression: mean - minOfFinites(mean), output_layer: above}
"""


def a_map() -> GridMap:
    values = np.random.default_rng(0).normal(size=(70, 55))
    values[20:24, 30:33] = np.nan
    return GridMap((7.0, 5.5), 0.1, layers={"elevation": values}, frame_id="map")


@pytest.fixture
def command(grid_map_command):
    """Return `grid_map_command` in a folder with a map in a store and a chain."""
    from grid_map_core_py.tiled import open_map

    Path("chain.yaml").write_text(CHAIN)
    open_map(a_map().to_xarray(), chunks=16).to_zarr("site.zarr")
    return grid_map_command


@pytest.mark.parametrize("where", ["", "--threads 2", "--workers 1 --memory 1GB"])
def test_result_is_that_of_the_whole_map(command, where):
    code, output, error = command(f"filter chain.yaml site.zarr out.zarr --json {where}")
    assert (code, error) == (0, "grid-map: 70 x 55 cells in out.zarr\n")
    assert json.loads(output.splitlines()[-1])["tiles"] == 5 * 4
    expected = FilterChain.from_yaml("chain.yaml")(load("site.zarr"))
    assert_maps_equal(load("out.zarr"), expected, atol=1e-5)


@pytest.mark.needs("rasterio")
def test_some_layers_from_raster_to_store_and_back(command):
    assert command("convert site.zarr site.tif")[0] == 0
    words = "filter chain.yaml site.tif out.zarr --chunks 20 --layers above mean --quiet"
    code, _, error = command(words)
    assert (code, error) == (0, "grid-map: 70 x 55 cells in out.zarr\n")
    expected = FilterChain.from_yaml("chain.yaml")(load("site.tif"))
    found = load("out.zarr")
    assert {*found.layers} == {"above", "mean"}
    np.testing.assert_allclose(found["above"], expected["above"], atol=1e-5)
    assert command("filter chain.yaml site.zarr out.tif --layers above --cog")[0] == 0
    np.testing.assert_allclose(load("out.tif")["above"], expected["above"], atol=1e-5)


def test_holes_that_are_too_long(command, refused):
    code, error = refused("filter chain.yaml site.zarr out.zarr --max-hole 3")
    assert (code, "hole" in error) == (1, True)
    assert not Path("out.zarr").exists()
    words = "filter chain.yaml site.zarr out.zarr --max-hole 3 --large-holes leave"
    assert command(words)[0] == 0
    assert np.isnan(load("out.zarr")["filled"][21, 31])


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("site.zarr out.zarr --timing", "--timing is for maps that are read at once"),
        ("site.zarr out.zarr --keep-going", "--keep-going is for maps that are read at once"),
        ("site.zarr out.npz --max-hole 3", "--max-hole is for maps that are filtered on tiles"),
        ("site.zarr out.npz --json", "--json is for what --timing prints"),
        ("site.zarr out.npz --resume", "--resume is for maps that are converted or filtered"),
    ],
)
@pytest.mark.usefixtures("command")
def test_wrong_lines_are_refused(refused, words, text):
    code, error = refused(f"filter chain.yaml {words}")
    assert (code, text in error) == (2, True), error
