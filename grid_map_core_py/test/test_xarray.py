# SPDX-License-Identifier: BSD-3-Clause
"""Maps as datasets of xarray, in memory and of Dask, and back; compared with maps in memory."""

import subprocess
import sys
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, strategies as st

from grid_map_core_py import GridMap, Interpolation, load, save
from grid_map_core_py.errors import (
    ConfigError,
    GeometryError,
    GridMapError,
    LimitError,
    MissingPackageError,
    OutOfMapError,
)
from grid_map_core_py.limits import changed_limits
from grid_map_core_py.testing import assert_maps_equal, grid_maps, moved_in_buffer
from grid_map_core_py.tiled import TiledMap, open_map

pytestmark = [
    pytest.mark.needs("xarray"),
    pytest.mark.filterwarnings("error:.*:UserWarning"),
]

needs_dask = pytest.mark.needs("dask")


def terrain(size=(12, 7)) -> GridMap:
    rows, columns = np.indices(size)
    return GridMap(
        np.multiply(size, 0.5),
        0.5,
        (3.0, -2.0),
        {"elevation": np.sin(0.7 * rows) + 0.1 * columns, "variance": rows * 100.0 + columns},
        basic_layers=["elevation"],
        frame_id="odom",
        timestamp=1_700_000_000_123_456_789,
    )


def raster(values, **options):
    """Return an array as rioxarray has it: y descends, x ascends."""
    import xarray

    values = np.asarray(values)
    x = 0.5 + np.arange(values.shape[-1])
    y = 9.5 - np.arange(values.shape[-2])
    dimensions = ("band", "y", "x")[-values.ndim :]
    return xarray.DataArray(values, {"y": y, "x": x}, dimensions, **options)


# --- there and back -------------------------------------------------------------------------------


@given(
    grid_map=grid_maps(("elevation", "variance")),
    turned=st.tuples(st.booleans(), st.booleans()),
    is_transposed=st.booleans(),
)
def test_map_is_the_same_after_a_dataset_in_any_order(grid_map, turned, is_transposed):
    dataset = grid_map.to_xarray()
    flips = {name: slice(None, None, -1) for name, flip in zip("xy", turned, strict=True) if flip}
    dataset = dataset.isel(flips)
    dataset = dataset.transpose("y", "x") if is_transposed else dataset
    before = grid_map.copy()
    again = GridMap.from_xarray(dataset)
    assert again == grid_map
    assert again.layers == grid_map.layers
    again["elevation"][...] = 7.0
    assert grid_map == before


def test_dataset_has_the_values_and_centers_of_the_map():
    grid_map = terrain()
    dataset = grid_map.to_xarray()
    assert dict(dataset.sizes) == {"x": 12, "y": 7}
    for cell in [(0, 0), (3, 5), (11, 6)]:
        x, y = grid_map.get_position(cell)
        found = dataset["variance"].sel(x=x, y=y)
        assert found == grid_map["variance"][cell]
    assert dataset["variance"].dtype == np.float32
    assert dataset.attrs == {
        "layers": ["elevation", "variance"],
        "frame_id": "odom",
        "timestamp": 1_700_000_000_123_456_789,
        "basic_layers": ["elevation"],
        "resolution": 0.5,
        "position": [3.0, -2.0],
    }


def test_only_a_moved_map_is_copied():
    grid_map = terrain()
    dataset = grid_map.to_xarray()
    assert all(np.shares_memory(dataset[name].values, grid_map[name]) for name in grid_map)
    moved = moved_in_buffer(grid_map, (5, 2))
    assert not np.shares_memory(moved.to_xarray()["elevation"].values, moved["elevation"])
    assert moved.to_xarray().identical(dataset)


@given(grid_map=grid_maps(), data=st.data())
def test_part_of_a_dataset_is_the_submap(grid_map, data):
    rows, columns = (
        data.draw(st.tuples(st.integers(0, n - 1), st.integers(1, n))) for n in grid_map.size
    )
    window = slice(rows[0], rows[0] + rows[1]), slice(columns[0], columns[0] + columns[1])
    part = grid_map.to_xarray().isel(x=window[0], y=window[1])
    assert_maps_equal(GridMap.from_xarray(part), grid_map.get_block(*window))


def test_attributes_that_are_outdated_give_way_to_the_coordinates():
    coarse = terrain((12, 8)).to_xarray().coarsen(x=2, y=2).mean(keep_attrs=True)
    found = GridMap.from_xarray(coarse)
    assert (found.size, found.resolution) == ((6, 4), 1.0)
    np.testing.assert_allclose(found.position, (3.0, -2.0))
    shifted = coarse.assign_coords(x=coarse.x + 5.0)
    np.testing.assert_allclose(GridMap.from_xarray(shifted).position, (8.0, -2.0))


@needs_dask
@pytest.mark.parametrize("moved", [(0, 0), (5, 2)])
def test_assigned_array_is_aligned_by_its_coordinates(moved):
    grid_map = moved_in_buffer(terrain(), moved)
    array = grid_map.to_xarray()["variance"]
    wide = terrain((16, 11)).to_xarray()["variance"]
    wide[2:14, 2:9] = array.values
    for value in (array, array.T, array[::-1, ::-1], array.T[::-1], array.chunk(), wide):
        grid_map["b"] = value
        grid_map.set_unwrapped("c", value)
        for layer in (grid_map["b"], grid_map["c"], grid_map.with_layers({"d": value})["d"]):
            np.testing.assert_array_equal(layer, grid_map["variance"])
    shifted = array.assign_coords(x=array.x + 0.2)
    for wrong in (array[1:], shifted, array.rename(x="lon"), array.drop_vars("x"), array.variable):
        with pytest.raises(GeometryError, match="layer 'b': expected the dimensions x and y with"):
            grid_map["b"] = wrong


# --- rasters --------------------------------------------------------------------------------------


def test_array_becomes_a_layer_named_like_it():
    values = np.arange(6.0).reshape(2, 3)
    for array, name in ((raster(values), "elevation"), (raster(values, name="dem"), "dem")):
        grid_map = GridMap.from_xarray(array)
        assert grid_map.layers == (name,)
        assert (grid_map.frame_id, grid_map.timestamp) == ("map", 0)
        # x ascends to the right, y upwards.
        assert grid_map.at_position(name, (0.5, 9.5)) == 0.0
        assert grid_map.at_position(name, (2.5, 8.5)) == 5.0


def test_bands_become_layers():
    values = np.arange(12.0).reshape(2, 2, 3)
    named = raster(values, attrs={"long_name": ("dem", "slope")})
    assert GridMap.from_xarray(named).layers == ("dem", "slope")
    assert GridMap.from_xarray(raster(values)).layers == ("band_1", "band_2")
    assert GridMap.from_xarray(raster(values[:1])).layers == ("elevation",)
    dataset = raster(values, name="part").to_dataset()
    grid_map = GridMap.from_xarray(dataset)
    assert grid_map.layers == ("part_1", "part_2")
    np.testing.assert_array_equal(grid_map["part_2"], values[1].T[::-1])


def test_marked_values_are_nan_and_scales_are_applied():
    attrs = {"_FillValue": -9999, "scale_factor": 0.1, "add_offset": 100.0}
    array = raster(np.array([[1, -9999], [3, 4]], np.int16), attrs=attrs)
    layer = GridMap.from_xarray(array)["elevation"]
    np.testing.assert_allclose(layer.T[:, ::-1], [[100.1, np.nan], [100.3, 100.4]], rtol=1e-6)
    grid_map = GridMap.from_xarray(array)
    grid_map["assigned"] = array
    np.testing.assert_array_equal(grid_map["assigned"], layer)


@pytest.mark.needs("rasterio", "rioxarray", "pyproj")
def test_rioxarray_and_load_read_the_same_map(tmp_path):
    import rioxarray

    grid_map = terrain()
    grid_map["variance"][2, 3] = np.nan
    save(grid_map, tmp_path / "dem.tif", crs="EPSG:25832")
    array = rioxarray.open_rasterio(tmp_path / "dem.tif")
    found = GridMap.from_xarray(array)
    found.frame_id, found.timestamp = grid_map.frame_id, grid_map.timestamp
    found.basic_layers = grid_map.basic_layers
    assert_maps_equal(found, load(tmp_path / "dem.tif"))


@pytest.mark.needs("rioxarray", "pyproj")
def test_rioxarray_finds_the_reference_system():
    import pyproj
    import rioxarray  # noqa: F401

    wkt = pyproj.CRS("EPSG:25832").to_wkt()
    for crs in ("EPSG:25832", wkt, "+proj=utm +zone=32 +ellps=GRS80 +units=m"):
        dataset = terrain().to_xarray(crs=crs)
        assert dataset.rio.crs == pyproj.CRS(crs)
        assert dataset["elevation"].rio.crs == pyproj.CRS(crs)
        assert dataset["spatial_ref"].attrs["grid_mapping_name"] == "transverse_mercator"
    assert "spatial_ref" not in terrain().to_xarray().coords
    with pytest.raises(ConfigError, match=r"crs: expected WKT, a code .*, got 'EPSG:nothing'"):
        terrain().to_xarray(crs="EPSG:nothing")


def test_degrees_are_taken_for_meters_with_a_warning():
    array = raster([[1.0, 2.0]])
    array["x"].attrs["units"] = "degrees_east"
    with pytest.warns(UserWarning, match="dataset: x and y are in degrees, which are treated"):
        GridMap.from_xarray(array)


def test_missing_xarray_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    expected = r"a dataset needs the package 'xarray'.*install python3-xarray"
    with pytest.raises(MissingPackageError, match=expected):
        GridMap((1.0, 1.0), 0.5).to_xarray()
    with pytest.raises(MissingPackageError, match=expected):
        GridMap.from_xarray(None)


# --- wrong inputs ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        (lambda _: np.zeros((2, 2)), GridMapError, "expected a Dataset or DataArray of xarray"),
        (lambda d: d.rename(x="lon"), GeometryError, r"x: expected the dimensions x and y"),
        (lambda d: d.assign_coords(x=d.x**3), GeometryError, "x: expected evenly spaced"),
        (lambda d: d.assign_coords(y=2 * d.y), GeometryError, r"squares, got 0.5 x 1 m"),
        (
            lambda d: d.expand_dims(time=3),
            GridMapError,
            r"'elevation': expected .* x and y, got \('time', 'x', 'y'\); dataset.isel\(time=0\)",
        ),
        (lambda d: d.astype(str), GridMapError, "layer 'elevation': expected numbers, got <U"),
        (lambda d: d.assign_attrs(origin=1.0), GridMapError, "origin: expected two numbers .*1.0"),
        (lambda d: d.assign_attrs(basic_layers=3), GridMapError, "basic_layers: expected names"),
    ],
)
def test_one_error_says_what_is_wrong(change, error, text):
    with pytest.raises(error, match=text):
        GridMap.from_xarray(change(terrain().to_xarray()), ["elevation"])


@needs_dask
def test_limit_of_cells_is_checked_before_values_are_computed():
    def fail(block):
        raise AssertionError(block)

    dataset = terrain((40, 30)).to_xarray().chunk()
    dataset["elevation"] = dataset["elevation"].copy(
        data=dataset["elevation"].data.map_blocks(fail, dtype=np.float32, meta=np.empty((0, 0)))
    )
    with changed_limits(max_cells=1000), pytest.raises(LimitError, match="map: expected at"):
        GridMap.from_xarray(dataset)


# --- Zarr -----------------------------------------------------------------------------------------


@pytest.mark.needs("zarr", "dask")
@pytest.mark.parametrize("crs", ["", 'LOCAL_CS["site",UNIT["metre",1]]'])
def test_stores_are_read_by_xarray_and_as_maps(tmp_path, crs):
    import xarray

    grid_map = terrain()
    grid_map["elevation"][3, 4] = np.nan
    grid_map.to_xarray(crs=crs).to_zarr(tmp_path / "a.zarr", consolidated=False)
    first = open_map(tmp_path / "a.zarr", chunks=5)
    first.to_zarr(tmp_path / "b.zarr")
    for name, is_consolidated in (("a.zarr", False), ("b.zarr", True)):
        dataset = xarray.open_zarr(tmp_path / name, consolidated=is_consolidated)
        assert GridMap.from_xarray(dataset) == grid_map
        assert open_map(tmp_path / name).to_map() == grid_map
        assert open_map(tmp_path / name).crs == crs
    assert dataset["elevation"].chunksizes == {"x": (5, 5, 2), "y": (5, 2)}


# --- datasets of Dask -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Recorded:
    """Layers of a map in memory that records the windows that are read."""

    grid_map: GridMap
    windows: list = field(default_factory=list)

    @property
    def layers(self):
        return self.grid_map.layers

    def describe(self):
        return "a map in memory"

    def prepare(self):
        """Do nothing."""

    def read(self, window, names):
        self.windows.append((window, tuple(names)))
        return [self.grid_map.unwrapped(name)[window].copy("F") for name in names]


def tiled(grid_map: GridMap, tile):
    """Return a tiled map that records its reads, and the map in memory."""
    about = grid_map.frame_id, grid_map.timestamp, grid_map.basic_layers
    return TiledMap(Recorded(grid_map), grid_map.geometry, tile, *about), grid_map


@needs_dask
@given(grid_map=grid_maps(("elevation", "variance")), data=st.data())
def test_lazy_dataset_has_one_chunk_per_tile(grid_map, data):
    tile = tuple(data.draw(st.integers(1, count + 2)) for count in grid_map.size)
    site, _ = tiled(grid_map, tile)
    dataset = site.to_xarray()
    assert not site.source.windows
    assert dataset.attrs == grid_map.to_xarray().attrs
    chunks = dataset["variance"].data.chunks
    assert [{*part[:-1]} | {max(part)} for part in chunks] == [
        {min(side, count)} for side, count in zip(tile, grid_map.size, strict=True)
    ]
    computed = dataset.compute(scheduler="synchronous")
    assert computed.identical(grid_map.to_xarray())
    assert len(site.source.windows) == len(site.tiles)


@needs_dask
@pytest.mark.parametrize("scheduler", ["threads", "synchronous"])
def test_tile_is_computed_once_for_all_its_layers(scheduler):
    site, _ = tiled(terrain((20, 14)), (6, 5))
    dataset = site.to_xarray()

    def reads(result) -> int:
        site.source.windows.clear()
        values = result.compute(scheduler=scheduler)
        assert np.isfinite(values.to_array() if hasattr(values, "data_vars") else values).all()
        return len(site.source.windows)

    tiles = len(site.tiles)
    assert reads(dataset) == tiles
    assert reads((dataset["elevation"] * 2 + dataset["variance"]).mean()) == tiles
    assert reads(dataset[["variance"]].isel(x=slice(5, 7), y=slice(0, 5))) == 2
    # The others are computed with it, unless they are left out.
    assert {names for _, names in site.source.windows} == {("elevation", "variance")}
    selected = site.to_xarray(["variance"])
    reads(selected)
    assert {names for _, names in site.source.windows} == {("variance",)}


# --- values at positions --------------------------------------------------------------------------


@needs_dask
@given(grid_map=grid_maps(max_side=16), data=st.data())
def test_values_at_positions_are_those_of_the_whole_map(grid_map, data):
    tile = tuple(data.draw(st.integers(1, count + 1)) for count in grid_map.size)
    site, _ = tiled(grid_map, tile)
    # Borders and centers of cells are where rounding decides.
    halves = [data.draw(st.lists(st.integers(0, 2 * n), min_size=6, max_size=6)) for n in tile]
    lattice = np.transpose(halves) * 0.5 * grid_map.resolution
    inner = data.draw(st.lists(st.tuples(*[st.floats(0, 1)] * 2), max_size=8))
    corner = grid_map.position + 0.5 * grid_map.length
    points = corner - np.concatenate([lattice, np.reshape(inner, (-1, 2)) * grid_map.length])
    points = points[grid_map.is_inside(points)]
    for method in Interpolation:
        expected = grid_map.at_position("elevation", points, method)
        np.testing.assert_array_equal(site.at_position("elevation", points, method), expected)
    for point in points[:2]:
        one = site.at_position("elevation", point, "linear")
        assert isinstance(one, float)
        np.testing.assert_equal(one, grid_map.at_position("elevation", point, "linear"))


@needs_dask
def test_only_cells_around_the_positions_are_read():
    site, grid_map = tiled(terrain((100, 90)), (20, 15))
    near, far = grid_map.get_position((50, 40)), grid_map.get_position((99, 0))
    site.at_position("variance", [near, near + 0.6, far], "cubic")
    assert len(site.source.windows) == 2
    read = sum(np.prod([w.stop - w.start for w in window]) for window, _ in site.source.windows)
    assert read < 120
    assert {names for _, names in site.source.windows} == {("variance",)}
    site.source.windows.clear()
    assert site.at_position("variance", np.empty((0, 2))).shape == (0,)
    assert site.at_position("variance", np.tile(near, (2, 3, 1))).shape == (2, 3)
    assert len(site.source.windows) == 1


# --- the accessor ---------------------------------------------------------------------------------


class Neighbors:
    """Stand-in for a chain: the sum of each cell and its neighbor in the next row."""

    def __call__(self, grid_map):
        layer = grid_map["elevation"]
        following = np.vstack([layer[1:], np.full_like(layer[:1], np.nan)])
        return grid_map.with_layers({"sum": layer + following})

    def on_tiles(self, site):
        return Summed(site, self)


@dataclass(frozen=True)
class Summed:
    site: object
    chain: Neighbors

    @property
    def layers(self):
        return *self.site.layers, "sum"

    @property
    def basic_layers(self):
        return self.site.basic_layers

    def describe(self):
        return "sums"

    def prepare(self):
        """Do nothing."""

    def read(self, window, names):
        from grid_map_core_py.tiled._source import widened, within

        around = widened(window, 1, self.site.size)
        result = self.chain(self.site.get_block(*around))
        return [result[name][within(window, around)].copy("F") for name in names]


@pytest.fixture(params=["memory", pytest.param("dask", marks=needs_dask)])
def dataset(request):
    """Return a dataset like that of rioxarray, in memory or of Dask."""
    dataset = terrain().to_xarray().isel(x=slice(None, None, -1)).transpose("y", "x")
    # One bit beside where the geometry has them.
    dataset = dataset.assign_coords(x=np.nextafter(dataset.x, np.inf))
    return dataset.chunk(x=5, y=3) if request.param == "dask" else dataset


def test_accessor_filters_in_the_order_of_the_dataset(dataset):
    import xarray

    found = dataset.grid_map.filter(Neighbors())
    assert bool(found["sum"].chunks) == bool(dataset["elevation"].chunks)
    assert found["sum"].dims == ("y", "x")
    xarray.testing.assert_equal(found.coords.to_dataset(), dataset.coords.to_dataset())
    # x ascends here, so that the next row is the one before.
    expected = dataset["elevation"] + dataset["elevation"].shift(x=1)
    np.testing.assert_array_equal(found["sum"], expected)
    expected_map = Neighbors()(terrain())
    assert_maps_equal(found.grid_map.to_map(), expected_map)


@needs_dask
@pytest.mark.parametrize("is_kept", [False, True])
def test_second_filter_reads_windows_of_the_first(is_kept):
    site, grid_map = tiled(terrain((20, 14)), (10, 7))
    first = site.filter(Neighbors()).to_xarray()
    # As rioxarray has it; the second chain sees the layers of the first one.
    turned = first.isel(x=slice(None, None, -1)).transpose("y", "x")
    again = turned.grid_map.filter(Neighbors())
    kept = again.persist() if is_kept else again
    site.source.windows.clear()
    found = kept.grid_map.filter(Neighbors())["sum"].grid_map.to_map()
    np.testing.assert_array_equal(found["sum"], Neighbors()(grid_map)["sum"])
    cells = sum(np.prod([p.stop - p.start for p in window]) for window, _ in site.source.windows)
    assert (cells == 0) == is_kept
    changed = kept.assign(sum=kept["sum"] * 2).drop_vars("elevation").rename(sum="elevation")
    twice = changed.grid_map.filter(Neighbors()).grid_map.to_map(["elevation"])
    np.testing.assert_array_equal(twice["elevation"], 2 * found["sum"])


def test_accessor_cuts_and_samples_as_a_map(dataset):
    grid_map = GridMap.from_xarray(dataset)
    assert dataset.grid_map.to_map() == grid_map
    assert dataset.grid_map.to_map(["variance"]).layers == ("variance",)
    part = dataset.grid_map.get_submap((3.0, -2.0), (2.2, 1.1))
    assert part["elevation"].dims == ("y", "x")
    assert bool(part["elevation"].chunks) == bool(dataset["elevation"].chunks)
    assert_maps_equal(part.grid_map.to_map(), grid_map.get_submap((3.0, -2.0), (2.2, 1.1)))
    points = [(3.1, -2.2), (0.2, -0.5)]
    values = dataset.grid_map.at_position("elevation", points, "cubic")
    np.testing.assert_array_equal(values, grid_map.at_position("elevation", points, "cubic"))
    with pytest.raises(OutOfMapError, match="does not overlap the map"):
        dataset.grid_map.get_submap((50.0, 0.0), (1.0, 1.0))


def test_arrays_have_the_accessor():
    array = terrain().to_xarray()["variance"]
    assert array.grid_map.to_map().layers == ("variance",)
    bands = raster(np.arange(12.0).reshape(2, 2, 3))
    assert list(bands.grid_map.get_submap((1.5, 8.5), (0.1, 0.1)).sizes.values()) == [1, 1]


def test_import_registers_the_accessor():
    code = """
import xarray, grid_map_core_py.xarray
dataset = xarray.Dataset(coords={"x": [1.5, 0.5], "y": [0.5]})
assert dataset.grid_map.to_map().size == (2, 1)
"""
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)
