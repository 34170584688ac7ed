# SPDX-License-Identifier: BSD-3-Clause
"""GeoTIFF files, against rasterio."""

import warnings
import zipfile
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from command_line import a_map
from test_tiled_rasters import write

from grid_map_core_py import GridMap, GridMapError, change_resolution
from grid_map_core_py.files import load, load_geotiff, save, save_geotiff
from grid_map_core_py.files._geotiff import describe_geotiff, read_pixels
from grid_map_core_py.files._shared import map_facts
from grid_map_core_py.testing import assert_maps_equal
from grid_map_core_py.tiled import open_map

pytestmark = [pytest.mark.needs("rasterio"), pytest.mark.usefixtures("in_folder")]

PIXELS = np.array([[[1, 2, 3], [4, -9, 6]]], np.int16)
"""Bands; their rows run to the south, and their columns to the east."""


@pytest.fixture
def rasterio():
    return pytest.importorskip("rasterio")


@pytest.mark.parametrize("compress", [False, True])
def test_rasterio_finds_every_value_at_its_position(rasterio, compress):
    grid_map = a_map()
    save_geotiff(grid_map, "map.tif", crs="EPSG:25832", compress=compress)
    with rasterio.open("map.tif") as raster:
        assert raster.descriptions == grid_map.layers
        assert raster.crs.to_epsg() == 25832
        assert np.isnan(raster.nodata)
        assert raster.res == pytest.approx((0.1, 0.1))
        for band, layer in enumerate(grid_map, 1):
            pixels = raster.read(band)
            for position in grid_map.get_positions():
                expected = grid_map[layer][grid_map.get_index(position)]
                np.testing.assert_equal(pixels[raster.index(*position)], expected)


def test_map_round_trips():
    expected = a_map()
    expected.timestamp = 3_000_000_007
    save(expected, "map.tif")
    back = load("map.tif")
    expected.convert_to_default_start_index()
    assert_maps_equal(back, expected)
    assert back["color"].tobytes() == expected["color"].tobytes()
    assert describe_geotiff("map.tif")["map"] == map_facts(back)


@pytest.mark.needs("pyproj", "xarray", "zarr", "dask")
@pytest.mark.parametrize("origin", [None, (48.75, 9.01)])
def test_reference_system_survives_files_and_copies(rasterio, origin):
    grid_map = GridMap((40.0, 30.0), 10.0, (500_100.0, 5_400_100.0), {"elevation": 1.0})
    save(grid_map, "first.tif", crs="EPSG:25832")
    found = open_map("first.tif", origin=origin).to_map()
    for ending in (".npz", ".tif"):
        save(found, f"next{ending}")
        found = load(f"next{ending}")
        assert map_facts(found)["crs"] == "EPSG:25832"
    open_map(found.to_xarray()).to_zarr("next.zarr")
    found = open_map("next.zarr").to_map()
    assert map_facts(found)["crs"] == "EPSG:25832"
    found = found.copy().get_submap(found.position, found.length)
    found = change_resolution(found.without_layers([]), 5.0)
    found["same"] = found.to_xarray()["elevation"]
    save(GridMap.from_xarray(found.to_xarray(crs=25832)), "last.tif", crs="EPSG:25832")
    with rasterio.open("first.tif") as first, rasterio.open("last.tif") as last:
        assert (last.crs, last.bounds) == (first.crs, first.bounds)
    assert not found.get_transformed_map(np.eye(4), "elevation", "odom").crs


@pytest.mark.needs("xarray", "dask", "pyproj")
@pytest.mark.parametrize("wrong", ["EPSG:nothing", 2.5])
def test_reference_system_of_any_type_is_taken_or_refused(wrong, rasterio):
    save(GridMap((1, 1), 0.5, layers={"a": 1.0}), "map.tif", crs=25832)
    grid_map = load("map.tif")
    for take_crs in (
        partial(save, grid_map, "new.tif"),
        grid_map.to_xarray,
        partial(open_map, "map.tif"),
    ):
        take_crs(crs=rasterio.crs.CRS.from_epsg(25833))
        with pytest.raises(GridMapError, match=f"crs: expected WKT, a code .*, got '?{wrong}"):
            take_crs(crs=wrong)


def test_foreign_rasters_may_have_mask_and_scale():
    write("dem.tif", PIXELS, nodata=-9, scale=(0.5, 10.0))
    dem = load_geotiff("dem.tif")
    assert (dem.layers, dem.frame_id, dem.resolution) == (("elevation",), "map", 2.0)
    assert describe_geotiff("dem.tif")["map"]["crs"] == "EPSG:25832"
    for (row, column), value in np.ndenumerate(PIXELS[0]):
        position = (691_001.0 + 2 * column, 5_334_999.0 - 2 * row)
        expected = np.nan if value == -9 else 10.0 + 0.5 * value
        np.testing.assert_equal(dem.at_position("elevation", position), expected)
    assert load_geotiff("dem.tif", layers=[]).layers == ()
    write("large.tif", 500_000_000 + PIXELS.astype(np.int32), scale=(1.0, -5e8))
    np.testing.assert_array_equal(load_geotiff("large.tif")["elevation"].T[:, ::-1], PIXELS[0])


@pytest.mark.parametrize("scale", [(np.inf, 0.0), (1.0, np.nan)])
def test_scale_or_offset_that_is_not_finite_is_refused(scale):
    write("dem.tif", PIXELS, scale=scale)
    with pytest.raises(GridMapError, match=r"dem\.tif: .*band 1: expected a finite scale and off"):
        load("dem.tif")


def test_properties_of_all_bands_are_read_once(rasterio):
    asked = Counter()

    class Asked:
        def __getattr__(self, name):
            asked[name] += 1
            return getattr(raster, name)

    write("dem.tif", np.repeat(PIXELS, 3, axis=0))
    images = np.empty((3, *PIXELS[0].shape), np.float32)
    with rasterio.open("dem.tif") as raster:
        read_pixels(Asked(), [1, 2, 3], (slice(0, 2), slice(0, 3)), images)
    assert (images == PIXELS).all()
    assert {*asked.values()} == {1}


def test_bands_are_layers():
    write("dem.tif", np.repeat(PIXELS, 3, axis=0), names=("", "slope", ""))
    assert load_geotiff("dem.tif").layers == ("band_1", "slope", "band_3")
    assert load_geotiff("dem.tif", ["slope"]).layers == ("slope",)


def test_a_cropped_raster_keeps_its_place_and_names(rasterio):
    save_geotiff(a_map(), "map.tif")
    with rasterio.open("map.tif") as raster:
        window = rasterio.windows.Window(2, 1, 4, 3)
        profile = raster.profile | {"width": 4, "height": 3}
        profile["transform"] = raster.window_transform(window)
        with rasterio.open("part.tif", "w", **profile) as part:
            part.update_tags(**raster.tags())
            part.write(raster.read(window=window))
            part.descriptions = raster.descriptions
    part, whole = load_geotiff("part.tif"), a_map()
    found = part.size, part.timestamp, part.basic_layers
    assert found == ((4, 3), whole.timestamp, ("elevation",))
    for position in part.get_positions():
        expected = whole["elevation"][whole.get_index(position)]
        np.testing.assert_equal(part.at_position("elevation", position), expected)


@pytest.mark.filterwarnings("ignore:Dataset has no")
@pytest.mark.filterwarnings("ignore:.*geotransform")
def test_rasters_without_map_are_refused():
    write("dem.tif", PIXELS, transform=None)
    with pytest.raises(GridMapError, match="has no position"):
        load("dem.tif")
    Path("text.tif").write_text("no raster")
    with pytest.raises(GridMapError, match=r"text\.tif: cannot be read"):
        load("text.tif")
    with pytest.raises(GridMapError, match="no layer 'none'"):
        load(write("good.tif", PIXELS), layers=["none"])
    write("dem.tif", PIXELS.astype(np.complex64))
    with pytest.raises(GridMapError, match="expected real numbers, got complex64"):
        load("dem.tif")


@pytest.mark.parametrize(
    ("crs", "warning"),
    [
        ("EPSG:4326", "is in degrees, which are treated as meters"),
        ("EPSG:2263", r"is in units of 0.3048006 m \(US survey foot\), which are treated"),
        ("EPSG:25832", ""),
        ('LOCAL_CS["hall",UNIT["metre",1]]', ""),
    ],
)
def test_coordinates_that_are_not_meters_warn(crs, warning):
    write("dem.tif", PIXELS, crs=crs)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        load("dem.tif")
    assert [bool(warning) for _ in found] == ([True] if warning else [])
    if warning:
        assert found[0].filename == __file__
        with pytest.warns(UserWarning, match=warning):
            load_geotiff("dem.tif")


@pytest.mark.parametrize(
    ("fill", "others", "nodata", "count"),
    [
        (-9999, (800, 2600), None, 2),
        (-9999, (800, 2600), -9999, 0),
        (1e20, (-3, 5), None, 2),
        (-9999, (-9000, 9000), None, 0),
        (0, (254, 255), None, 0),
        (1000, (0, 0), None, 0),
        (-9999, (-9999, -9999), None, 0),
    ],
)
def test_undeclared_nodata_warns(fill, others, nodata, count):
    pixels = np.linspace(*others, 60, dtype=np.float32).reshape(1, 6, 10)
    pixels[0, 1, 2:6] = fill
    write("fill.tif", pixels, nodata=nodata)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        load_geotiff("fill.tif")
        open_map("fill.tif").to_map()
    text = f"fill.tif: {fill:g} fills many cells, and no nodata value is declared"
    assert [text in str(one.message) for one in found] == [True] * count


def test_virtual_files_of_gdal_are_read():
    with zipfile.ZipFile("dem.zip", "w") as archive:
        archive.write(write("dem.tif", PIXELS))
    assert load(f"/vsizip/{Path('dem.zip').absolute()}/dem.tif") == load("dem.tif")
