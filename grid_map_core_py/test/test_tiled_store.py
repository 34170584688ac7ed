# SPDX-License-Identifier: BSD-3-Clause
"""Zarr stores as others read and write them: CRS, addresses, formats, readers of one window."""

import json
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import a_map as a_map_with_infinity
from test_tiled_rasters import UTM

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.map import GridGeometry
from grid_map_core_py.testing import assert_maps_equal
from grid_map_core_py.tiled import TiledMap, open_map

pytestmark = pytest.mark.needs("xarray", "zarr")


def a_map() -> GridMap:
    made = a_map_with_infinity()
    made["variance"] = 0.25
    return made


@pytest.fixture
def store(tmp_path: Path) -> Path:
    made = a_map()
    about = {name: getattr(made, name) for name in ("basic_layers", "frame_id", "timestamp")}
    TiledMap.create(tmp_path / "a.zarr", made.geometry, made.layers, chunks=3, crs=UTM, **about)
    open_map(tmp_path / "a.zarr").write(made)
    return tmp_path / "a.zarr"


def test_resolution_and_place_are_those_of_the_map(store: Path) -> None:
    site = pickle.loads(pickle.dumps(open_map(store)))
    assert_maps_equal(site.to_map(), a_map())
    window = (1.0, 2.0), (0.55, 0.35)
    assert site.get_submap(*window) == a_map().get_submap(*window)


@pytest.mark.needs("dask")
def test_links_to_stores_stay_when_the_store_is_replaced(store: Path, tmp_path: Path) -> None:
    (tmp_path / "link.zarr").symlink_to(store)
    expected = GridMap((1.0, 1.0), 0.5, layers={"elevation": 3.0})
    open_map(expected.to_xarray()).to_zarr(tmp_path / "link.zarr", overwrite=True)
    assert (tmp_path / "link.zarr").is_symlink()
    assert_maps_equal(open_map(store).to_map(), expected)


def test_huge_chunks_are_refused(store: Path) -> None:
    document = json.loads((store / ".zmetadata").read_text())
    document["metadata"]["variance/.zarray"]["chunks"] = [22_000, 22_000]
    (store / ".zmetadata").write_text(json.dumps(document))
    text = "a.zarr: variance: chunk: expected at most 16000000 cells, got 22000 x 22000"
    with pytest.raises(GridMapError, match=text):
        open_map(store)


@pytest.mark.needs("fsspec")
def test_store_at_an_address_is_read(store: Path, tmp_path: Path) -> None:
    import fsspec

    memory: Any = fsspec.filesystem("memory")
    memory.put(str(store), "/a.zarr", recursive=True)
    site = open_map("memory://a.zarr")
    assert_maps_equal(site.to_map(), a_map())
    site.to_zarr(tmp_path / "copy.zarr")
    assert_maps_equal(open_map(tmp_path / "copy.zarr").to_map(), a_map())
    with pytest.raises(GridMapError, match="expected a folder of this machine"):
        site.write(a_map())
    memory.rm("/a.zarr", recursive=True)
    with pytest.raises(GridMapError, match=r"^memory://b\.zarr: cannot be read"):
        open_map("memory://b.zarr")


@pytest.mark.parametrize("form", [2, 3])
def test_stores_of_xarray_of_both_formats(tmp_path: Path, form: int) -> None:
    import zarr

    from grid_map_core_py.tiled._datasets import to_dataset

    if zarr.__version__.startswith("2."):
        pytest.skip("writes format 2 only")
    with pytest.warns() if form == 3 else pytest.MonkeyPatch.context():
        to_dataset(a_map()).to_zarr(tmp_path / "a.zarr", zarr_format=form)
    site = open_map(tmp_path / "a.zarr")
    assert_maps_equal(site.to_map(), a_map())
    expected = a_map()
    place = expected.get_position((4, 5))
    site.write(GridMap((0.1, 0.1), 0.1, place, {"variance": 9.0}, frame_id="odom"))
    expected["variance"][4, 5] = 9.0
    assert_maps_equal(open_map(tmp_path / "a.zarr").to_map(), expected)


def test_window_of_a_billion_cells_reads_four_chunks(tmp_path: Path) -> None:
    geometry = GridGeometry.from_size((31_623, 31_623), 0.1)
    site = TiledMap.create(tmp_path / "a.zarr", geometry, ["elevation", "variance"], chunks=512)
    center = geometry.centers((1024, 2048)) + 0.05
    values = np.random.default_rng(0).normal(size=(1000, 1000))
    site.write(GridMap((100, 100), 0.1, center, {"elevation": values, "variance": 1.0}))

    site = open_map(tmp_path / "a.zarr")
    window = site.get_submap(center, (20.0, 20.0))
    np.testing.assert_array_equal(window["elevation"], values[400:600, 400:600].astype("f4"))
    opened: list[str] = []
    sys.addaudithook(lambda event, about: opened.append(str(about[0])) if event == "open" else None)
    site.get_submap(center, (20.0, 20.0))
    chunks = [name for name in opened if str(tmp_path) in name]
    opened.clear()
    assert len({*chunks}) == len(chunks) == 2 * 4


def test_zarr_prints_nothing(tmp_path: Path) -> None:
    code = (
        "from grid_map_core_py import GridMap; from grid_map_core_py.map import GridGeometry\n"
        "from grid_map_core_py.tiled import TiledMap, open_map\n"
        "site = TiledMap.create('a.zarr', GridGeometry.from_size((9, 9), 1.0), ['a'], chunks=4)\n"
        "site.write(GridMap((3, 3), 1.0, layers={'a': 1.0})); site.to_zarr('b.zarr')\n"
        "open_map('b.zarr').to_map()"
    )
    command = [sys.executable, "-W", "always", "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == done.stderr == ""
