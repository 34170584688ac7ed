# SPDX-License-Identifier: BSD-3-Clause
"""Windows of constant size, and work on the newest of some things, without a node."""

import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from sites import make_site

from grid_map_core_py import GridMap, LimitError
from grid_map_core_py.files import save_geotiff
from grid_map_core_py.limits import changed_limits
from grid_map_core_py.tiled import TiledMap, open_map
from grid_map_ros_py._serving import LatestOnly, open_source, window

pytestmark = pytest.mark.needs("xarray", "zarr")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> tuple[TiledMap, GridMap]:
    path: Path = tmp_path_factory.mktemp("site") / "site.zarr"
    whole = make_site(path)
    return open_map(path), whole


@given(
    st.tuples(st.integers(-30, 430), st.integers(-30, 280)),
    st.tuples(st.integers(1, 40), st.integers(1, 40)),
    st.booleans(),
)
def test_window_is_nan_off_the_map(site, cell, size, is_even):
    tiled, whole = site
    padded = np.pad(whole["elevation"], 100, constant_values=np.nan)
    # In the middle of a window: of a cell, or of a corner between four of them.
    position = whole.geometry.corner - 0.1 * (np.array(cell) + 0.5)
    position -= 0.05 * (np.array(size) % 2 == 0)
    found = window(tiled, position + (0.02 if is_even else -0.02), size, ["elevation"])
    assert found.size == size
    first = np.array(cell) - (np.array(size) - 1) // 2 + 100
    expected = padded[first[0] : first[0] + size[0], first[1] : first[1] + size[1]]
    np.testing.assert_array_equal(found["elevation"], expected)
    np.testing.assert_allclose(found.position, position, atol=1e-9)


def test_window_larger_than_the_map_contains_it(site):
    tiled, whole = site
    found = window(tiled, whole.position, (403, 257), ["variance", "elevation"])
    np.testing.assert_array_equal(found["variance"][1:-1, 2:-2], whole["variance"])
    assert np.isnan(found["variance"][0]).all()
    assert (found.layers, found.basic_layers) == (("variance", "elevation"), ("elevation",))
    with changed_limits(max_cells=9), pytest.raises(LimitError, match="window: expected at most 9"):
        window(tiled, whole.position, (4, 4), ["variance"])


@pytest.mark.needs("rasterio", "pyproj")
def test_rasters_are_sources_in_a_frame_with_an_origin(tmp_path):
    paths, place = [str(tmp_path / "a.tif")], (691_000.0, 5_335_000.0)
    values = np.random.default_rng(1).random((80, 60), np.float32)
    raster = GridMap((40.0, 30.0), 0.5, place, layers={"elevation": values})
    save_geotiff(raster, paths[0], crs="EPSG:25832")
    site = open_source(paths, "odom")
    found = window(site, place, (4, 8), ["elevation"])
    assert found.frame_id == "odom"
    np.testing.assert_array_equal(found["elevation"], values[38:42, 26:34])
    local = open_source(paths, "odom", tuple(site.latitude_longitude_of(place)))
    again = window(local, (0.0, 0.0), (4, 8), ["elevation"])
    np.testing.assert_array_equal(again["elevation"], found["elevation"])
    np.testing.assert_allclose(again.position, (0.0, 0.0), atol=0.01)


def test_thread_takes_the_newest_thing_and_keeps_errors():
    begun, go_on, done = threading.Event(), threading.Event(), []

    def work(thing: int) -> None:
        begun.set()
        assert go_on.wait(10)
        if thing == 3:
            raise ValueError("three")
        done.append(thing)

    latest = LatestOnly(work)
    latest.put(1)
    assert begun.wait(10)
    for thing in (2, 3):
        latest.put(thing)
    go_on.set()
    assert latest.close(10)
    assert done == [1]
    first, second = latest.outcomes()
    assert first is None
    assert str(second) == "three"
    assert [*latest.outcomes()] == []
    latest.put(4)
    assert done == [1]


def test_closing_works_on_what_waits_or_gives_up():
    hangs, done = threading.Event(), []
    idle = LatestOnly(done.append)
    assert idle.close(10)
    busy = LatestOnly(lambda thing: (hangs.wait(10), done.append(thing)))
    busy.put(1)
    assert not busy.close(0.05)
    hangs.set()
    assert busy.close(10)
    assert done == [1]
