# SPDX-License-Identifier: BSD-3-Clause
"""Maps that are merged into Zarr stores, compared with `GridMap.add_data_from` in memory."""

import multiprocessing
import shutil
import warnings
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GeometryError, GridMapError, LayerNotFoundError, OutOfMapError
from grid_map_core_py.map import GridGeometry
from grid_map_core_py.testing import assert_maps_equal, moved_in_buffer
from grid_map_core_py.tiled import TiledMap, open_map

pytestmark = [
    pytest.mark.needs("xarray", "zarr"),
    pytest.mark.filterwarnings("error:.*:UserWarning"),
]

HAS_ZARR = find_spec("zarr") is not None
# zarr-python 2 writes this format only.
FORMAT_2 = {"zarr_format": 2} if HAS_ZARR and metadata.version("zarr") >= "3" else {}

SIZE, RESOLUTION, CENTER = (23, 17), 0.5, (3.0, -1.0)


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return make_store(tmp_path / "site.zarr")


def make_store(path: Path) -> Path:
    geometry = GridGeometry.from_size(SIZE, RESOLUTION, CENTER)
    layers = ["elevation", "variance"]
    TiledMap.create(path, geometry, layers, chunks=6, basic_layers=["elevation"])
    return path


def patch(size=(5, 4), position=(3.1, -0.9), value: float = 1.0) -> GridMap:
    values = value + np.arange(size[0] * size[1], dtype=np.float32).reshape(size)
    return GridMap.from_geometry(
        GridGeometry.from_size(size, RESOLUTION, position),
        {"elevation": values, "variance": -values},
        frame_id="map",
    )


def chunk_files(store: Path) -> dict[str, bytes]:
    return {
        f"{file.parent.name}/{file.name}": file.read_bytes()
        for layer in ("elevation", "variance")
        for file in (store / layer).iterdir()
        if not file.name.startswith(".")
    }


patches = st.builds(
    dict,
    size=st.tuples(st.integers(1, 12), st.integers(1, 12)),
    cells=st.tuples(st.integers(-16, 16), st.integers(-14, 14)),
    phase=st.tuples(*[st.sampled_from([0.0, 0.1, -0.24, 0.25, 0.4])] * 2),
    start=st.tuples(st.floats(0, 0.99), st.floats(0, 0.99)),
    seed=st.integers(0, 99),
)


@settings(max_examples=25)
@given(patches=st.lists(patches, min_size=1, max_size=3))
def test_write_equals_add_data_from(patches: list[dict[str, object]]) -> None:
    with TemporaryDirectory() as folder:
        site = open_map(make_store(Path(folder, "site.zarr")))
        expected = site.to_map()
        for one in patches:
            part = random_patch(**one)
            try:
                site.write(part)
            except OutOfMapError:
                assert_maps_equal(added(site.to_map(), part), site.to_map())
            expected = added(expected, part)
        assert_maps_equal(site.to_map(), expected)


def random_patch(size, cells, phase, start, seed) -> GridMap:
    random = np.random.default_rng(seed)
    position = np.add(CENTER, np.multiply(np.add(cells, 0.5 * np.subtract(size, SIZE)), RESOLUTION))
    part = patch(size, position + phase)
    for name in part:
        part[name][...] = random.choice([np.nan, np.inf, -1.0, 2.0, 3.5], size)
    return moved_in_buffer(part, tuple(int(f * n) for f, n in zip(start, size, strict=True)))


def added(whole: GridMap, part: GridMap) -> GridMap:
    whole.add_data_from(part, extend_map=False, overwrite_data=True)
    return whole


def test_write_touches_only_chunks_under_the_map(store: Path) -> None:
    site = open_map(store)
    site.write(patch((23, 17), CENTER))
    before = chunk_files(store)
    assert len(before) == 2 * 4 * 3
    site.write(patch((2, 2), site.geometry.centers(([6, 7], [0, 1])).mean(axis=0), 99.0))
    after = chunk_files(store)
    changed = {name for name in after if after[name] != before[name]}
    assert changed == {"elevation/1.0", "variance/1.0"}


def test_write_of_some_layers(store: Path) -> None:
    site, part = open_map(store), patch()
    part["color"] = 3.0
    with pytest.raises(GridMapError, match=r"lacks the layers color of the map.*'layers'"):
        site.write(part)
    assert chunk_files(store) == {}
    site.write(part, layers=["variance"])
    assert np.isnan(site.to_map()["elevation"]).all()
    assert np.isfinite(site.to_map()["variance"]).sum() == 20
    with pytest.raises(LayerNotFoundError):
        site.write(part, layers=["slope"])


@pytest.mark.parametrize(
    ("part", "error", "text"),
    [
        (patch(position=(300.0, 0.0)), OutOfMapError, "no cell of it is on the store"),
        (GridMap((1, 1), 0.25, CENTER, ["elevation"]), GeometryError, "cells of 0.5 m"),
        (GridMap((1, 1), 0.5, CENTER, ["elevation"], frame_id="odom"), GridMapError, "'map', got"),
    ],
)
def test_write_refuses_other_maps(
    store: Path, part: GridMap, error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        open_map(store).write(part)
    assert chunk_files(store) == {}


@pytest.mark.parametrize("transposed", [False, True])
def test_write_into_a_foreign_store(tmp_path: Path, transposed: bool) -> None:
    """The store has ascending coordinates, another order of dimensions, and chunks of its own."""
    import xarray

    rows, columns = np.arange(7) * RESOLUTION, np.arange(9) * RESOLUTION
    values = np.random.default_rng(1).normal(size=(7, 9))
    dataset = xarray.Dataset(
        {"elevation": (("x", "y"), values)}, {"x": rows, "y": columns}, {"resolution": RESOLUTION}
    )
    dataset = dataset.transpose("y", "x") if transposed else dataset
    path = tmp_path / "foreign.zarr"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dataset.to_zarr(path, encoding={"elevation": {"chunks": (4, 3)}}, **FORMAT_2)
    site = open_map(path)
    expected = site.to_map()
    np.testing.assert_array_equal(expected["elevation"], values[::-1, ::-1].astype(np.float32))
    part = patch((3, 5), (2.0, 2.5))
    site.write(part, layers=["elevation"])
    expected.add_data_from(part, extend_map=False, overwrite_data=True, layers=["elevation"])
    assert_maps_equal(open_map(path).to_map(), expected)


def test_write_refuses_a_store_of_scaled_integers(tmp_path: Path) -> None:
    import xarray

    encoding = {"elevation": {"dtype": "i2", "scale_factor": 0.1, "_FillValue": -999}}
    axis = np.arange(4) * RESOLUTION
    dataset = xarray.Dataset({"elevation": (("x", "y"), np.eye(4))}, {"x": axis, "y": axis})
    dataset.to_zarr(tmp_path / "a.zarr", encoding=encoding, **FORMAT_2)
    site = open_map(tmp_path / "a.zarr")
    np.testing.assert_allclose(site.to_map()["elevation"], np.eye(4))
    with pytest.raises(GridMapError, match="expected a layer of floats"):
        site.write(patch(position=(0.0, 0.0)), layers=["elevation"])


def write_column(path: Path, column: int, barrier: Any) -> None:
    site = open_map(path)
    barrier.wait()
    for row in range(site.size[0]):
        center = site.geometry.centers((row, column))
        site.write(GridMap((0.5, 0.5), 0.5, center, {"elevation": float(100 * row + column)}))


def test_two_processes_write_the_same_chunks(store: Path) -> None:
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(2)
    writers = [
        context.Process(target=write_column, args=(store, column, barrier), daemon=True)
        for column in (2, 3)
    ]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join(30)
    assert [writer.exitcode for writer in writers] == [0, 0]
    expected = np.full(SIZE, np.nan, np.float32)
    expected[:, 2:4] = 100 * np.arange(SIZE[0])[:, None] + [2, 3]
    np.testing.assert_array_equal(open_map(store).to_map()["elevation"], expected)


def test_full_disk_leaves_the_store_as_it_was(store: Path, full_disk) -> None:
    site = open_map(store)
    site.write(patch())
    before = chunk_files(store)
    values = np.random.default_rng(1).normal(size=SIZE)
    noise = GridMap.from_geometry(site.geometry, {"elevation": values})
    with full_disk(64), pytest.raises(GridMapError, match=r"site.zarr/elevation: cannot be writt"):
        site.write(noise)
    assert chunk_files(store) == before


def test_write_tells_that_the_store_was_replaced(tmp_path: Path) -> None:
    path = make_store(tmp_path / "site.zarr")
    site = open_map(path)
    shutil.rmtree(path)
    with pytest.raises(GridMapError, match="No such file"):
        site.write(patch())
    TiledMap.create(path, GridGeometry.from_size((3, 3), RESOLUTION), ["elevation"])
    with pytest.raises(GridMapError, match="has been replaced"):
        site.write(patch(), layers=["elevation"])
    shutil.rmtree(path)
    moved = GridGeometry.from_size(SIZE, RESOLUTION, np.add(CENTER, 9 * RESOLUTION))
    TiledMap.create(path, moved, site.layers)
    with pytest.raises(GridMapError, match="has been replaced"):
        site.to_map(["elevation"])


@pytest.mark.parametrize("name", ["a/b", ".hidden", "x", ""])
def test_names_that_a_store_cannot_hold(tmp_path: Path, name: str) -> None:
    with pytest.raises(GridMapError, match="names that a Zarr store can hold"):
        TiledMap.create(tmp_path / "a.zarr", GridGeometry.from_size((3, 3), 1.0), [name])
    assert [*tmp_path.iterdir()] == []


def test_layer_that_is_a_link_is_not_written(store: Path, tmp_path: Path) -> None:
    outside = (store / "elevation").rename(tmp_path / "outside")
    (store / "elevation").symlink_to(outside)
    before = sorted(outside.iterdir())
    with pytest.raises(GridMapError, match=r"site\.zarr/elevation: expected a folder, got a link"):
        open_map(store).write(patch())
    assert sorted(outside.iterdir()) == before


def test_create_keeps_what_is_there(store: Path) -> None:
    with pytest.raises(GridMapError, match=r"site.zarr: already exists"):
        make_store(store)
    with pytest.raises(GridMapError, match="a folder of this machine"):
        make_store("s3://bucket/site.zarr")  # type: ignore[arg-type]
    assert [file.name for file in store.parent.iterdir()] == ["site.zarr"]
