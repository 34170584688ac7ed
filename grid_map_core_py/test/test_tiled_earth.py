# SPDX-License-Identifier: BSD-3-Clause
"""Latitude and longitude in tiled maps, against GDAL."""

import math
from dataclasses import replace

import numpy as np
import pytest
from test_tiled_rasters import UTM, heights, write

from grid_map_core_py import GeometryError, GridMapError
from grid_map_core_py.files import load_geotiff
from grid_map_core_py.testing import assert_maps_equal
from grid_map_core_py.tiled import open_map

pytestmark = [
    pytest.mark.needs("dask", "rasterio", "pyproj"),
    pytest.mark.usefixtures("in_folder"),
]

PLACE = (48.137222, 11.575556)
"""Latitude and longitude [deg]."""


@pytest.mark.parametrize("crs", [UTM, "EPSG:32733", "EPSG:2154", "EPSG:3035", "EPSG:31468"])
def test_places_round_trip_and_equal_those_of_gdal(crs):
    from rasterio.warp import transform

    site = open_map(write("a.tif", heights(5, 5), crs=crs))
    generator = np.random.default_rng(3)
    latitude, longitude = generator.uniform(46, 49, 50), generator.uniform(9, 13, 50)
    positions = site.position_of(latitude, longitude)
    expected = transform("EPSG:4326", crs, longitude, latitude)
    np.testing.assert_allclose(positions.T, expected, atol=5.0 if crs == "EPSG:31468" else 1e-3)
    assert site.position_of(latitude[0], longitude[0]).shape == (2,)
    back = site.latitude_longitude_of(positions)
    np.testing.assert_allclose(back, np.stack([latitude, longitude], -1), atol=1e-7)


def test_unknown_places_are_nan():
    site = open_map(write("a.tif", heights(5, 5)))
    found = site.position_of([np.nan, 48.0, 95.0], [11.0, 11.0, 11.0])
    assert np.isnan(found).tolist() == [[True, True], [False, False], [True, True]]
    assert np.isnan(site.latitude_longitude_of([np.nan, 5e6])).all()
    assert site.position_of([], []).shape == (0, 2)


def test_errors_say_what_is_missing():
    without = open_map(write("a.tif", heights(5, 5), crs=None))
    for call in (without.position_of, without.with_origin):
        with pytest.raises(GridMapError, match="the map has no reference system, so its place"):
            call(*PLACE)
    with pytest.raises(GridMapError, match="the map has no reference system"):
        without.latitude_longitude_of((0.0, 0.0))
    site = replace(without, crs=UTM)
    with pytest.raises(GeometryError, match=r"latitude, longitude: expected two numbers or two"):
        site.position_of([1.0, 2.0], [1.0, 2.0, 3.0])
    with pytest.raises(GridMapError, match="origin: expected a place with coordinates in"):
        site.with_origin(math.nan, 11.0)


@pytest.mark.parametrize("crs", [UTM, "EPSG:2056", "EPSG:32661"])
def test_frame_has_its_origin_at_the_place(crs):
    far = open_map(write("a.tif", heights(30, 40), crs=crs))
    place = (46.9, 8.2) if crs != "EPSG:32661" else (84.0, 20.0)
    site = open_map("a.tif", origin=place)
    np.testing.assert_allclose(site.position_of(*place), 0.0, atol=1e-6)
    offset = far.position_of(*place)
    np.testing.assert_allclose(site.position, far.position - offset, atol=1e-6)
    np.testing.assert_array_equal(site.to_map()["elevation"], far.to_map()["elevation"])
    other = (place[0] + 0.1, place[1] - 0.2)
    np.testing.assert_allclose(
        site.position_of(*other), far.position_of(*other) - offset, atol=1e-6
    )
    again = site.with_origin(*other)
    np.testing.assert_allclose(again.position_of(*other), 0.0, atol=1e-6)


@pytest.mark.parametrize("crs", [UTM, "EPSG:3857", "EPSG:32661", "EPSG:2056", "EPSG:31468"])
def test_frame_survives_files(crs):
    import rasterio

    write("a.tif", heights(30, 40), crs=crs)
    x, y = open_map("a.tif").position_of(46.9, 8.2)
    write("a.tif", heights(30, 40), crs=crs, transform=rasterio.Affine(2, 0, x, 0, -2, y))
    site = open_map("a.tif")
    site = site.with_origin(*site.latitude_longitude_of(site.position + 1000))
    np.testing.assert_allclose(site.position, -1000, atol=0.01)
    site.to_geotiff("out.tif", cog=False)
    back = open_map("out.tif")
    assert (back.crs, back.origin) == (site.crs, site.origin)
    assert_maps_equal(back.to_map(), site.to_map())
    assert_maps_equal(load_geotiff("out.tif"), site.to_map())
    # Other programs find the raster where it was.
    with rasterio.open("a.tif") as before, rasterio.open("out.tif") as after:
        assert (before.bounds, before.crs) == (after.bounds, after.crs)
    place = site.latitude_longitude_of(site.position)
    np.testing.assert_allclose(back.position_of(*place), back.position, atol=0.01)


@pytest.mark.needs("zarr", "xarray")
def test_frame_survives_stores():
    site = open_map(write("a.tif", heights(30, 40)), origin=PLACE)
    site.to_zarr("out.zarr")
    back = open_map("out.zarr")
    np.testing.assert_allclose(back.position_of(*PLACE), 0.0, atol=1e-6)
    assert_maps_equal(back.to_map(), site.to_map())
    for dataset in (back.to_xarray(), back.to_xarray().compute()):
        assert dataset.grid_map.to_map() == back.to_map()
        found = dataset.grid_map.get_submap(back.position, (5.0, 5.0)).grid_map.to_map()
        assert_maps_equal(found, back.get_submap(back.position, (5.0, 5.0)))
        # Other programs find the map where it was.
        np.testing.assert_allclose(dataset.x, open_map("a.tif").to_xarray().x, atol=1e-6)
    # A store can get another origin, too.
    other = open_map("out.zarr", origin=(48.2, 11.6))
    expected = open_map("a.tif", origin=(48.2, 11.6))
    np.testing.assert_allclose(other.position, expected.position, atol=1e-5)


def test_projected_file_loses_the_frame_with_a_warning():
    import rasterio
    from rasterio.vrt import WarpedVRT

    open_map(write("a.tif", heights(30, 40)), origin=PLACE).to_geotiff("out.tif")
    with rasterio.open("out.tif") as raster, WarpedVRT(raster, crs="EPSG:32633") as projected:
        profile = {**projected.profile, "driver": "GTiff"}
        with rasterio.open("b.tif", "w", **profile) as after:
            after.write(projected.read())
            after.update_tags(**raster.tags())
            bounds = after.bounds
    for read in (open_map, load_geotiff):
        with pytest.warns(UserWarning, match=r"b\.tif: has been projected; the frame of its map"):
            found = read("b.tif")
        middle = [(bounds.left + bounds.right) / 2, (bounds.bottom + bounds.top) / 2]
        np.testing.assert_allclose(found.position, middle)


def test_info_says_where_the_origin_is(grid_map_command):
    site = open_map(write("a.tif", heights(30, 40)), origin=PLACE)
    site.to_geotiff("out.tif")
    code, output, error = grid_map_command("info out.tif")
    assert (code, error) == (0, "")
    x, _ = open_map("a.tif").position_of(*PLACE)
    assert f"origin    ({x:.6g}"[:14] in output
    assert f"position  ({site.position[0]:.4g}"[:14] in output
