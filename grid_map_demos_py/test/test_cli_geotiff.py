# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""GeoTIFF files, as rasterio itself writes and reads them."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import a_map

from grid_map_core_py import GridMap
from grid_map_core_py.files import load_npz, save_npz
from grid_map_core_py.testing import assert_maps_equal
from grid_map_demos_py.cli.main import main
from grid_map_demos_py.cli.reading import info_of, map_info

PIXELS = np.array([[1, 2, 3], [4, -9, 6]], np.int16)
"""Rows to the south, columns to the east."""


@pytest.fixture(autouse=True)
def in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def rasterio():
    return pytest.importorskip("rasterio")


def write(rasterio, name="dem.tif", pixels=PIXELS, **changes):
    """Write a raster with the corner at (100, 200) and pixels of 2 m."""
    options = {
        "driver": "GTiff",
        "count": 1,
        "height": pixels.shape[0],
        "width": pixels.shape[1],
        "dtype": pixels.dtype,
        "transform": rasterio.Affine(2.0, 0.0, 100.0, 0.0, -2.0, 200.0),
        **changes,
    }
    with rasterio.open(name, "w", **options) as raster:
        for band in range(1, options["count"] + 1):
            raster.write(pixels, band)
    return name


def convert(*words: str) -> None:
    assert main(["convert", *words]) == 0


@pytest.mark.parametrize("options", [(), ("--compress",)])
def test_rasterio_finds_every_value_where_the_map_has_it(rasterio, options):
    grid_map = a_map()
    save_npz(grid_map, "map.npz")
    convert("map.npz", "map.tif", "--crs", "EPSG:25832", *options)
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


@pytest.mark.usefixtures("rasterio")
def test_a_map_comes_back_the_same():
    save_npz(a_map(), "map.npz")
    convert("map.npz", "map.tif")
    convert("map.tif", "back.npz")
    told, expected = map_info("map.tif"), info_of(load_npz("map.npz"))
    assert told._replace(geometry=expected.geometry) == expected
    assert told.geometry.position == pytest.approx(expected.geometry.position)
    back = load_npz("back.npz")
    assert_maps_equal(back, load_npz("map.npz"))
    assert back["color"].tobytes() == load_npz("map.npz")["color"].tobytes()


def test_rasters_of_others_are_read_with_their_mask_and_scale(rasterio):
    write(rasterio, nodata=-9)
    with rasterio.open("dem.tif", "r+") as raster:
        raster.scales, raster.offsets = (0.5,), (10.0,)
    convert("dem.tif", "dem.npz")
    dem = load_npz("dem.npz")
    assert (dem.layers, dem.frame_id, dem.resolution) == (("elevation",), "map", 2.0)
    for (row, column), value in np.ndenumerate(PIXELS):
        position = (101.0 + 2 * column, 199.0 - 2 * row)
        expected = np.nan if value == -9 else 10.0 + 0.5 * value
        np.testing.assert_equal(dem.at_position("elevation", position), expected)


def test_bands_are_layers_and_may_be_chosen(rasterio):
    write(rasterio, count=3)
    with rasterio.open("dem.tif", "r+") as raster:
        raster.set_band_description(2, "slope")
    convert("dem.tif", "all.npz")
    convert("dem.tif", "slope.npz", "--layer", "slope", "--frame", "utm")
    assert load_npz("all.npz").layers == ("band_1", "slope", "band_3")
    assert (load_npz("slope.npz").layers, load_npz("slope.npz").frame_id) == (("slope",), "utm")


def test_a_raster_that_is_cut_keeps_its_place_and_its_names(rasterio):
    save_npz(a_map(), "map.npz")
    convert("map.npz", "map.tif")
    with rasterio.open("map.tif") as raster:
        window = rasterio.windows.Window(2, 1, 4, 3)
        profile = raster.profile | {"width": 4, "height": 3}
        profile["transform"] = raster.window_transform(window)
        with rasterio.open("part.tif", "w", **profile) as part:
            part.update_tags(**raster.tags())
            part.write(raster.read(window=window))
            part.descriptions = raster.descriptions
    convert("part.tif", "part.npz")
    part, whole = load_npz("part.npz"), a_map()
    assert (part.size, part.timestamp, part.basic_layers) == (
        (4, 3),
        whole.timestamp,
        ("elevation",),
    )
    for position in part.get_positions():
        expected = whole["elevation"][whole.get_index(position)]
        np.testing.assert_equal(part.at_position("elevation", position), expected)


def refusal(capsys, *words: str) -> str:
    assert main([*words]) == 1
    error: str = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


def test_object_other_than_a_map_is_refused(rasterio, capsys):
    turned = rasterio.Affine(2.0, 0.5, 0.0, 0.5, -2.0, 0.0)
    oblong = rasterio.Affine(2.0, 0.0, 0.0, 0.0, -1.0, 0.0)
    for transform in (turned, oblong):
        write(rasterio, transform=transform)
        assert "dem.tif: cannot be read: expected square pixels" in refusal(
            capsys, "info", "dem.tif"
        )
    with pytest.warns(rasterio.errors.NotGeoreferencedWarning):
        write(rasterio, transform=rasterio.Affine.identity())
    assert "does not say where it lies" in refusal(capsys, "info", "dem.tif")
    Path("text.tif").write_text("no raster")
    assert "text.tif: cannot be read" in refusal(capsys, "info", "text.tif")
    assert "no layer 'none'" in refusal(
        capsys, "inspect", write(rasterio, "good.tif"), "--layer", "none"
    )
    write(rasterio, pixels=PIXELS.astype(np.complex64))
    assert "expected real numbers, found complex64" in refusal(capsys, "inspect", "dem.tif")
    save_npz(GridMap((1, 1), 0.5), "empty.npz")
    assert "has no layers" in refusal(capsys, "convert", "empty.npz", "x.tif")
    save_npz(a_map(), "map.npz")
    assert "x.tif: cannot be written" in refusal(
        capsys, "convert", "map.npz", "x.tif", "--crs", "EPSG:nothing"
    )
    assert not list(Path().glob("*x.tif*"))


@pytest.mark.parametrize(
    ("crs", "warning"),
    [
        ("EPSG:4326", "is in degrees, which are taken for metres"),
        ("EPSG:2263", "is in units of 0.3048006 m (US survey foot), which are taken for metres"),
        ("EPSG:25832", ""),
        ('LOCAL_CS["hall",UNIT["metre",1]]', ""),
    ],
)
def test_what_is_not_in_metres_is_read_with_a_warning(crs, warning, rasterio, capsys):
    write(rasterio, crs=crs)
    assert main(["inspect", "dem.tif"]) == 0
    error = capsys.readouterr().err
    assert warning in error
    assert bool(error) == bool(warning)


def test_the_reference_system_of_a_raster_stays_unless_another_is_named(rasterio, capsys):
    write(rasterio, crs="EPSG:25832")
    convert("dem.tif", "same.tif")
    convert("dem.tif", "other.tif", "--crs", "EPSG:25833")
    for name, code in (("same.tif", 25832), ("other.tif", 25833)):
        with rasterio.open(name) as raster:
            assert raster.crs.to_epsg() == code
    capsys.readouterr()
    assert main(["info", "same.tif", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["map"]["crs"] == "EPSG:25832"
    assert main(["info", "same.tif"]) == 0
    assert "crs       EPSG:25832\n" in capsys.readouterr().out


def test_without_rasterio_one_error_names_it(tmp_path):
    save_npz(a_map(), tmp_path / "map.npz")
    code = (
        "import sys; sys.modules['rasterio'] = None; from grid_map_demos_py.cli.main import main; "
        "sys.exit(main(['convert', 'map.npz', 'map.tif']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr == (
        "grid-map: error: map.tif: GeoTIFF needs the package 'rasterio', which is not installed: "
        "pip install rasterio\n"
    )
