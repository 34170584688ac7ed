# SPDX-License-Identifier: BSD-3-Clause
"""Files that earlier releases have written stay readable."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from grid_map_core_py import GridMap, GridMapError, load
from scratch import ROOT

FILES = ROOT / "test/data/formats"
"""One file of each format, written by version 0.2.0 from `written_map()`."""

LOSSLESS = ("map.npz", "map.zarr", "map.tif", "bag", "bag_sqlite3")


def written_map() -> GridMap:
    heights = np.arange(12, dtype=np.float32).reshape(4, 3) / 4
    heights[1, 2] = np.nan
    grid_map = GridMap((2.0, 1.5), 0.5, (0.5, -1.0), {"elevation": heights}, frame_id="odom")
    grid_map.basic_layers = ["elevation"]
    grid_map.timestamp = 1_700_000_000_000_000_001
    return grid_map


@pytest.mark.needs("rasterio", "zarr")
@pytest.mark.parametrize("name", LOSSLESS)
def test_lossless_files_of_earlier_releases_give_the_same_map(name):
    expected = written_map()
    loaded = load(FILES / name)
    assert loaded.geometry == expected.geometry
    assert (loaded.frame_id, loaded.timestamp) == (expected.frame_id, expected.timestamp)
    assert loaded.basic_layers == expected.basic_layers
    np.testing.assert_array_equal(loaded["elevation"], expected["elevation"])


def test_images_of_earlier_releases_give_the_same_values():
    expected = written_map()["elevation"]
    loaded = load(FILES / "height.png", resolution=0.5, lower=0.0, upper=2.75)
    np.testing.assert_allclose(loaded["elevation"], expected, atol=1e-4)
    loaded = load(FILES / "map_server.yaml")
    np.testing.assert_allclose(loaded["occupancy"], expected / 2.75 * 100, atol=0.5)


@pytest.mark.needs("zarr")
def test_store_of_a_later_version_is_refused(tmp_path):
    store = Path(shutil.copytree(FILES / "map.zarr", tmp_path / "map.zarr"))
    for name in (".zattrs", ".zmetadata"):
        path = store / name
        path.write_text(path.read_text().replace('"grid_map_version": 1', '"grid_map_version": 2'))
    assert json.loads((store / ".zattrs").read_text())["grid_map_version"] == 2
    with pytest.raises(GridMapError, match=r"expected a store of version 1, got 2\. Install"):
        load(store)
