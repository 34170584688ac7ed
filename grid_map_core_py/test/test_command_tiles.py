# SPDX-License-Identifier: BSD-3-Clause
"""Maps of any size on the command line: Zarr stores, windows, clusters."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from grid_map_core_py import GridMap, load, save
from grid_map_core_py.map import GridGeometry
from grid_map_core_py.testing import assert_maps_equal
from grid_map_core_py.tiled import TiledMap, open_map

pytestmark = pytest.mark.needs("xarray", "zarr", "distributed", "pyproj")

SIZE = (60, 45)


def a_map() -> GridMap:
    values = np.random.default_rng(0).normal(size=SIZE)
    values[10:20, 30:35], values[40, 1] = np.nan, np.inf
    options = {"frame_id": "utm", "timestamp": 5, "basic_layers": ["elevation"]}
    layers = {"elevation": values, "a": 2.0}
    return GridMap(np.multiply(SIZE, 0.5), 0.5, (7.0, -3.0), layers, **options)


@pytest.fixture
def command(grid_map_command):
    """Return `grid_map_command` in a folder with the map in a store."""
    open_map(a_map().to_xarray(crs="EPSG:25832"), chunks=16).to_zarr("site.zarr")
    return grid_map_command


def test_info_reads_the_description_only(command):
    for chunk in Path("site.zarr/elevation").glob("[0-9]*"):
        chunk.write_bytes(b"damaged")
    code, output, _ = command("info site.zarr")
    rows = dict(line.split(maxsplit=1) for line in output.splitlines()[1:])
    assert (code, output.splitlines()[0]) == (0, "site.zarr: zarr")
    assert rows == {
        "frame": "utm",
        "crs": "EPSG:25832",
        "time": "0.000000005 s",
        "size": "60 x 45 cells of 0.5 m",
        "length": "30 x 22.5 m",
        "position": "(7, -3)",
        "chunks": "16 x 16 cells",
        "layers": "elevation (basic), a",
    }
    assert json.loads(command("info site.zarr --json")[1])["map"]["chunks"] == [16, 16]


def test_stores_are_a_format_of_files(command):
    assert command("convert site.zarr site.npz")[0] == 0
    assert_maps_equal(load("site.npz"), a_map())
    assert command("convert site.npz copy.zarr --chunks 20 --crs EPSG:25833")[0] == 0
    assert_maps_equal(load("copy.zarr"), a_map())
    assert load("copy.zarr", layers=["a"]).layers == ("a",)
    save(load("copy.zarr"), "copy.zarr")


def test_convert_runs_on_tiles(command):
    code, output, error = command("convert site.zarr b.zarr --chunks 20 --layer a --frame map")
    assert (code, output) == (0, "")
    assert error.splitlines()[0].startswith(f"[{'#' * 30}] 9/9 tiles, ")
    assert error.splitlines()[1] == "grid-map: 60 x 45 cells in b.zarr"
    found = load("b.zarr")
    assert (found.layers, found.frame_id) == (("a",), "map")
    code, _, error = command("convert site.zarr b.zarr")
    assert (code, error) == (
        1,
        "grid-map: error: b.zarr: already exists; --force replaces it\n",
    )
    lines = command("convert site.zarr b.zarr --force --json")[1].splitlines()
    assert [json.loads(line)["tiles"] for line in (lines[0], lines[-1])] == [0, 12]
    assert_maps_equal(load("b.zarr"), a_map())


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        ("convert site.zarr b.zarr --memory 1GB", 2, "--memory goes with --workers"),
        ("convert site.zarr b.zarr --chunks 0", 1, "'chunks': expected a number of cells, got 0"),
        ("convert site.zarr b.npz --workers 2", 2, "--workers is for maps that are converted"),
        ("convert site.zarr b.zarr --workers 0", 2, "--workers: expected a number of at least 1"),
        ("convert gone.zarr b.zarr", 1, "gone.zarr: cannot be read: No such file or directory"),
        ("submap site.zarr a.npz --length 1 2", 2, "expected --position or --lat and --lon"),
        ("submap site.zarr a.npz --length 1 2 --position 99 0", 1, "does not overlap the map"),
    ],
)
@pytest.mark.usefixtures("command")
def test_wrong_lines_are_refused(refused, words, code, text):
    found, error = refused(words)
    assert (found, text in error) == (code, True), error
    assert {path.name for path in Path().iterdir()} == {"site.zarr"}


@pytest.mark.usefixtures("command")
def test_failed_run_says_how_to_continue(refused):
    Path("site.zarr/a/1.1").write_bytes(b"damaged")
    code, error = refused("convert site.zarr b.zarr --quiet")
    note = ". b.zarr.part keeps the finished tiles; --resume continues the run\n"
    assert (code, error.endswith(note)) == (1, True), error
    assert "b.zarr.part" not in refused("convert gone.zarr b.zarr")[1]


def test_inspect_of_tiles_equals_the_whole_map(command):
    lines = "inspect site.zarr --json", "inspect site.zarr --json --max-cells 2000"
    every = [json.loads(command(line)[1])["layers"] for line in lines]
    for whole, tiled in zip(*every, strict=True):
        rounded = {name: pytest.approx(whole[name]) for name in ("mean", "std")}
        assert tiled == whole | rounded
    assert (every[1][0]["nan"], every[1][0]["infinite"]) == (50, 1)


@pytest.mark.usefixtures("command")
def test_scheduler_that_does_not_answer(refused):
    from dask import config

    with config.set({"distributed.comm.timeouts.connect": "200ms"}):
        code, error = refused("convert site.zarr b.zarr --scheduler tcp://127.0.0.1:1")
    assert code == 1
    assert error.startswith("grid-map: error: tcp://127.0.0.1:1: the scheduler cannot be reached")


@pytest.mark.needs("rasterio")
def test_stores_become_cloud_optimized_rasters_and_back(command):
    code, _, error = command("convert site.zarr site.tif --cog")
    assert code == 0, error
    assert error.splitlines()[-1] == "grid-map: 60 x 45 cells in site.tif"
    assert_maps_equal(load("site.tif"), a_map())
    import rasterio

    with rasterio.open("site.tif") as raster:
        assert raster.crs.to_epsg() == 25832
        assert raster.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
    assert command("convert site.tif back.zarr --chunks 16")[0] == 0
    assert_maps_equal(load("back.zarr"), a_map())
    assert command("convert site.tif copy.tif --workers 1")[0] == 0
    assert_maps_equal(load("copy.tif"), a_map())
    for words in ("convert site.zarr other.tif", "convert site.zarr other.tif --cog --force"):
        assert command(f"{words} --crs EPSG:25833")[0] == 0
        with rasterio.open("other.tif") as raster:
            assert raster.crs.to_epsg() == 25833
    code, _, error = command("convert site.tif b.tif --resume")
    assert (code, "--resume is for" in error) == (2, True)


@pytest.mark.needs("rasterio")
def test_submap_around_a_place_on_the_earth(command):
    site = open_map("site.zarr")
    latitude, longitude = site.latitude_longitude_of((8.0, -2.0))
    words = f"submap site.zarr patch.npz --lat {latitude} --lon {longitude} --length 3 2"
    assert command(words)[0] == 0
    assert_maps_equal(
        load("patch.npz"), site.get_submap(site.position_of(latitude, longitude), (3, 2))
    )


def test_submap_is_that_of_the_map(command):
    words = "submap site.zarr patch.npz --position 8.1 -2.2 --length 3.2 6"
    assert command(words)[0] == 0
    expected = a_map().get_submap((8.1, -2.2), (3.2, 6.0))
    assert_maps_equal(load("patch.npz"), expected)
    assert command("submap patch.npz part.zarr --position 8 -2 --length 1 1 --layer a")[0] == 0
    expected = expected.get_submap((8, -2), (1, 1))
    np.testing.assert_array_equal(load("part.zarr")["a"], expected["a"])


def test_workers_are_processes_that_end_with_the_program(command):
    environ = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    words = "convert site.zarr b.zarr --chunks 8 --workers 2 --memory 1GB --json"
    line = [sys.executable, "-m", "grid_map_core_py", *words.split()]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": environ}
    with subprocess.Popen(line, **pipes) as run:
        assert run.stdout is not None
        run.stdout.readline()
        workers = children(run.pid)
        run.send_signal(signal.SIGINT)
        _, error = run.communicate(timeout=20)
    assert run.returncode == -signal.SIGINT
    assert error == "grid-map: b.zarr.part keeps the finished tiles; --resume continues the run\n"
    text = "b.zarr.part is left from a run that did not finish; --resume continues it\n"
    assert command("info b.zarr")[2].startswith(f"grid-map: {text}")
    assert not Path("b.zarr").exists()
    end = time.monotonic() + 20
    while any(Path("/proc", str(worker)).exists() for worker in workers):
        assert time.monotonic() < end
        time.sleep(0.02)


def children(process: int) -> list[int]:
    """Return the workers among the processes that a process has started."""
    return [
        int(word)
        for task in Path(f"/proc/{process}/task").iterdir()
        for word in (task / "children").read_text().split()
        if b"spawn_main" in Path("/proc", word, "cmdline").read_bytes()
    ]


@pytest.mark.parametrize(("step", "tile"), [(1, 16), (2, 5), (7, 16), (100, 100)])
def test_thinned_maps_have_every_nth_cell(step: int, tile: int) -> None:
    whole = a_map()
    found = open_map(whole.to_xarray(), chunks=tile).thinned(step)
    rows, columns = (np.arange(min(step // 2, n - 1), n, step) for n in SIZE)
    for name in whole:
        np.testing.assert_array_equal(found[name], whole[name][rows[:, None], columns])
    for axis, wanted in zip(found.axes(), (rows, columns), strict=True):
        centers = whole.axes()[0 if wanted is rows else 1][wanted]
        np.testing.assert_allclose(axis, centers, atol=1e-9)
    assert (found.frame_id, found.basic_layers) == ("utm", ("elevation",))


@pytest.mark.needs("rasterio")
@pytest.mark.parametrize("step", [1, 5])
def test_thinned_rasters_are_read_from_overviews(tmp_path: Path, step: int) -> None:
    import rasterio

    x, y = np.arange(1501)[:, None], np.arange(1102)
    whole = GridMap((150.1, 110.2), 0.1, (40.0, 7.0), {"elevation": 0.01 * x + 0.02 * y})
    open_map(whole.to_xarray()).to_geotiff(tmp_path / "dem.tif")
    with rasterio.open(tmp_path / "dem.tif") as raster:
        factor = max(f for f in [1, *raster.overviews(1)] if f <= step)
    found = open_map(tmp_path / "dem.tif", chunks=256).thinned(step)
    assert found.resolution == pytest.approx(0.1 * factor * -(-step // factor))
    assert factor > 1 or step == 1
    # The plane at the centers of the cells, which are in their places within half a cell.
    rows, columns = found.axes()
    wanted = 0.1 * (whole.position[0] + 0.5 * 150.1 - 0.05 - rows)[:, None] + 0.2 * (
        whole.position[1] + 0.5 * 110.2 - 0.05 - columns
    )
    np.testing.assert_allclose(
        found["elevation"][1:-1, 1:-1], wanted[1:-1, 1:-1], atol=0.015 * factor
    )


def test_thinned_map_of_very_many_tiles_reads_some(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grid_map_core_py.tiled._thinned._MOST_TILES", 20)
    geometry = GridGeometry.from_size((1000, 400), 0.1)
    tiled_map = TiledMap.create(tmp_path / "a.zarr", geometry, ["elevation"], chunks=10)
    assert math.prod(tiled_map.thinned(10).size) <= 20
    assert tiled_map.thinned(200).size == (5, 2)
