# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map filter` over a map, over all maps of a bag, and over a map of any size."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from grid_map_core_py import GridMap, load
from grid_map_core_py.files import save_npz
from grid_map_core_py.testing import assert_maps_equal, moved_in_buffer
from grid_map_filters_py import FilterChain
from grid_map_ros_py import BagReader, BagWriter, bag_maps, save_to_bag

CHAIN = """
grid_map_filters:
  ros__parameters:
    filters:
      filter1:
        name: twice
        type: gridMapFilters/MathExpressionFilter
        params: {expression: 2 * height, output_layer: double}
"""
SECOND = 1_000_000_000


def a_map(number: int, layer: str = "height") -> GridMap:
    grid_map = GridMap((1.0, 2.0), 0.5, layers={layer: number}, timestamp=number * SECOND)
    return moved_in_buffer(grid_map, (1, 2))


@pytest.fixture
def command(grid_map_command):
    """Return `grid_map_command` in a folder with maps."""
    Path("chain.yaml").write_text(CHAIN)
    with BagWriter("survey") as bag:
        for number in (1, 2, 3):
            bag.write("/grid_map", a_map(number), time=number * SECOND + 7)
    save_to_bag([a_map(1), a_map(2, "hight")], "bad", "/grid_map")
    save_npz(a_map(4), "site.npz")
    return grid_map_command


def test_chain_runs_over_a_bag_with_progress_and_times(command):
    code, text, error = command("filter chain.yaml survey out --timing --json --compress")
    assert code == 0, error
    bar, result = error.splitlines()
    assert bar.startswith("[##############################] 3/3 maps, ")
    assert result == "grid-map: 3 maps in out"
    (step,) = json.loads(text)
    assert step.keys() == {"name", "type", "maps", "last_ms", "mean_ms", "max_ms"}
    assert (step["name"], step["maps"]) == ("twice", 3)
    chain = FilterChain.from_yaml("chain.yaml")
    with BagReader("out") as bag:
        assert (bag.topic, [*bag.topics]) == ("/filtered_map", ["/filtered_map"])
        for number, record in enumerate(bag, 1):
            assert record.time == number * SECOND + 7
            actual = record.grid_map(unwrap=False)
            assert actual.start_index == (1, 2)
            assert_maps_equal(actual, chain(a_map(number)))


def test_chain_runs_over_one_map(command):
    assert command("filter chain.yaml site.npz out.npz --threads 2")[0] == 0
    assert (load("out.npz")["double"] == 8).all()
    assert command("filter chain.yaml survey one --index 0 --output-topic /one")[0] == 0
    assert [grid_map.timestamp for grid_map in bag_maps("one", "/one")] == [SECOND]
    error = command("filter chain.yaml survey last.npz --quiet")[2]
    assert error.splitlines()[0] == "grid-map: survey: last of 3 maps; --index selects another"


def test_chain_may_come_from_a_pipe(command):
    assert command("convert site.npz again.npz")[0] == 0
    words = [sys.executable, "-m", "grid_map_core_py"]
    words += ["filter", "-", "site.npz", "-", "--timing"]
    done = subprocess.run(words, input=CHAIN.encode(), capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    # The table goes to standard error if the map goes to standard output.
    assert b"twice" in done.stderr
    Path("out.npz").write_bytes(done.stdout)
    assert (load("out.npz")["double"] == 8).all()


@pytest.mark.needs("numba")
@pytest.mark.usefixtures("command")
def test_first_run_says_that_it_compiles(tmp_path):
    curvature = "type: gridMapFilters/CurvatureFilter\n        params: {input_layer: height,"
    Path("chain.yaml").write_text(f"{CHAIN.partition('type:')[0]}{curvature} output_layer: c}}")
    words = [sys.executable, "-m", "grid_map_core_py", "filter", "chain.yaml", "site.npz", "-"]
    environ = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    for text in (b"grid-map: numba compiles loops once, which takes some seconds\n", b""):
        assert subprocess.run(words, env=environ, capture_output=True).stderr == text


def test_a_failing_map_ends_it_or_is_left_out(command):
    code, _, error = command("filter chain.yaml bad out --quiet")
    assert (code, Path("out").exists()) == (1, False)
    assert error.startswith("grid-map: error: map 1: filter 1 'twice'")
    code, _, error = command("filter chain.yaml bad out --keep-going --quiet")
    assert code == 0
    assert "left out map 1" in error
    assert [float(grid_map["double"][0, 0]) for grid_map in bag_maps("out")] == [2.0]
    save_to_bag(a_map(1, "hight"), "bad", "/grid_map")
    code, _, error = command("filter chain.yaml bad out --keep-going --force")
    assert (code, "no maps to write" in error) == (1, True)
    assert "left out map 0: filter 1 'twice'" in error
    assert len([*bag_maps("out")]) == 1


def test_warnings_of_filters_are_shown_once(command):
    deletion = "type: gridMapFilters/DeletionFilter\n        params: {layers: [slope]}\n"
    Path("chain.yaml").write_text(CHAIN.partition("type:")[0] + deletion)
    code, _, error = command("filter chain.yaml survey out --quiet")
    assert code == 0
    assert error.count("no layer slope to delete") == 1


@pytest.mark.parametrize(
    ("line", "code", "text"),
    [
        ("none.yaml site.npz out.npz", 1, "none.yaml"),
        ("chain.yaml none out", 1, "none: cannot be read: No such file"),
        ("chain.yaml survey out --topic /map", 1, "'/map'; topics: /grid_map"),
        ("chain.yaml survey survey --force", 1, "is also the source"),
        ("chain.yaml survey/survey_0.mcap survey --force", 1, "is also the source"),
        ("site.npz chain.yaml out.npz", 2, "expected the chain first: chain.yaml site.npz"),
        ("- - out.npz", 2, "cannot both come from standard input"),
        ("chain.yaml site.npz out.npz --json", 2, "--timing"),
        ("chain.yaml site.npz out.npz --threads 0", 1, "expected an integer from 1 to 1000, got 0"),
    ],
)
def test_mistakes_are_one_line(line, code, text, refused):
    found, error = refused(f"filter {line}")
    assert (found, text in error) == (code, True), error
    assert not [*Path().glob("out*")]


# --- maps of any size -----------------------------------------------------------------------------

NEEDS_TILES = pytest.mark.needs("xarray", "zarr", "distributed")

TILES_CHAIN = """
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


def wide_map() -> GridMap:
    values = np.random.default_rng(0).normal(size=(70, 55))
    values[20:24, 30:33] = np.nan
    return GridMap((7.0, 5.5), 0.1, layers={"elevation": values}, frame_id="map")


@pytest.fixture
def on_store(grid_map_command):
    """Return `grid_map_command` in a folder with a map in a store and a chain."""
    from grid_map_core_py.tiled import open_map

    Path("tiles.yaml").write_text(TILES_CHAIN)
    open_map(wide_map().to_xarray(), chunks=16).to_zarr("site.zarr")
    return grid_map_command


@NEEDS_TILES
@pytest.mark.parametrize("where", ["", "--threads 2", "--workers 1 --memory 1GB"])
def test_result_is_that_of_the_whole_map(on_store, where):
    code, output, error = on_store(f"filter tiles.yaml site.zarr out.zarr --json {where}")
    assert (code, error) == (0, "grid-map: 70 x 55 cells in out.zarr\n")
    assert json.loads(output.splitlines()[-1])["tiles"] == 5 * 4
    expected = FilterChain.from_yaml("tiles.yaml")(load("site.zarr"))
    assert_maps_equal(load("out.zarr"), expected, atol=1e-5)


@NEEDS_TILES
@pytest.mark.parametrize("where", ["", "--workers 2"])
def test_warning_about_tiles_is_one_line(on_store, where):
    params = "{input_layer: elevation, output_layer: rough, radius: 0.01}"
    Path("rough.yaml").write_text(f"[{{name: rough, type: Roughness, params: {params}}}]")
    code, _, error = on_store(f"filter rough.yaml site.zarr out.zarr --quiet {where}")
    first, *others = error.splitlines()
    assert (code, others) == (0, ["grid-map: 70 x 55 cells in out.zarr"])
    assert first.startswith("grid-map: warning: filter 1 'rough' (Roughness): radius: expected at")


@pytest.mark.needs("rasterio", "zarr", "distributed")
def test_some_layers_from_raster_to_store_and_back(on_store):
    assert on_store("convert site.zarr site.tif")[0] == 0
    words = "filter tiles.yaml site.tif out.zarr --chunks 20 --layers above mean --quiet"
    code, _, error = on_store(words)
    assert (code, error) == (0, "grid-map: 70 x 55 cells in out.zarr\n")
    expected = FilterChain.from_yaml("tiles.yaml")(load("site.tif"))
    found = load("out.zarr")
    assert {*found.layers} == {"above", "mean"}
    np.testing.assert_allclose(found["above"], expected["above"], atol=1e-5)
    assert on_store("filter tiles.yaml site.zarr out.tif --layers above --cog")[0] == 0
    np.testing.assert_allclose(load("out.tif")["above"], expected["above"], atol=1e-5)


@NEEDS_TILES
def test_holes_that_are_too_long(on_store, refused):
    code, error = refused("filter tiles.yaml site.zarr out.zarr --max-hole 3")
    assert (code, "hole" in error) == (1, True)
    assert not Path("out.zarr").exists()
    words = "filter tiles.yaml site.zarr out.zarr --max-hole 3 --large-holes leave"
    assert on_store(words)[0] == 0
    assert np.isnan(load("out.zarr")["filled"][21, 31])


@NEEDS_TILES
@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("site.zarr out.zarr --timing", "--timing is for maps that are read at once"),
        ("site.zarr out.zarr --keep-going", "--keep-going is for maps that are read at once"),
        ("site.zarr out.npz --max-hole 3", "--max-hole is for maps that are filtered on tiles"),
        ("site.zarr out.npz --json", "--json requires --timing"),
        ("site.zarr out.npz --resume", "--resume is for maps that are converted or filtered"),
    ],
)
@pytest.mark.usefixtures("on_store")
def test_options_of_other_maps_are_refused(refused, words, text):
    code, error = refused(f"filter tiles.yaml {words}")
    assert (code, text in error) == (2, True), error
