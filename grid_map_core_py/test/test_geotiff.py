# SPDX-License-Identifier: BSD-3-Clause
"""GeoTIFF files, against rasterio."""

import contextlib
import http.server
import os
import subprocess
import sys
import threading
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest
from command_line import a_map
from memory import peak_of

from grid_map_core_py import GridMap, GridMapError
from grid_map_core_py.files import _geotiff, load, load_geotiff, map_facts, save, save_geotiff
from grid_map_core_py.files._geotiff import describe_geotiff, open_raster
from grid_map_core_py.testing import assert_maps_equal

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


@pytest.mark.usefixtures("rasterio")
def test_map_round_trips():
    expected = a_map()
    expected.timestamp = 3_000_000_007
    save(expected, "map.tif")
    back = load("map.tif")
    expected.convert_to_default_start_index()
    assert_maps_equal(back, expected)
    assert back["color"].tobytes() == expected["color"].tobytes()
    assert describe_geotiff("map.tif")["map"] == map_facts(back)


def test_foreign_rasters_may_have_mask_and_scale(rasterio):
    write(rasterio, nodata=-9, crs="EPSG:25832")
    with rasterio.open("dem.tif", "r+") as raster:
        raster.scales, raster.offsets = (0.5,), (10.0,)
    dem = load_geotiff("dem.tif")
    assert (dem.layers, dem.frame_id, dem.resolution) == (("elevation",), "map", 2.0)
    assert describe_geotiff("dem.tif")["map"]["crs"] == "EPSG:25832"
    for (row, column), value in np.ndenumerate(PIXELS):
        position = (101.0 + 2 * column, 199.0 - 2 * row)
        expected = np.nan if value == -9 else 10.0 + 0.5 * value
        np.testing.assert_equal(dem.at_position("elevation", position), expected)


def test_bands_are_layers(rasterio):
    write(rasterio, count=3)
    with rasterio.open("dem.tif", "r+") as raster:
        raster.set_band_description(2, "slope")
    assert load_geotiff("dem.tif").layers == ("band_1", "slope", "band_3")
    assert load_geotiff("dem.tif", ["slope"]).layers == ("slope",)


@pytest.mark.parametrize("window", [1, 16 * 16 * 4 * 3, 16 * 70 * 4 * 3 * 2, 2**24])
@pytest.mark.parametrize("interleave", ["pixel", "band"])
@pytest.mark.parametrize("shape", [{"tiled": True, "blockxsize": 16}, {}])
def test_bands_have_same_values_however_they_are_stored(
    rasterio, monkeypatch, window, interleave, shape
):
    monkeypatch.setattr(_geotiff, "_WINDOW", window)
    pixels = np.random.default_rng(2).integers(-9, 9, (3, 37, 70)).astype(np.float32)
    pixels[:, 5, 60:63] = np.inf, -np.inf, np.nan
    write(
        rasterio,
        pixels=pixels[0],
        count=3,
        nodata=-9,
        interleave=interleave,
        blockysize=16,
        **shape,
    )
    with rasterio.open("dem.tif", "r+") as raster:
        raster.write(pixels)
        raster.scales, raster.offsets = (1.0, 0.5, 1.0), (0.0, 0.0, 3.0)
    expected = np.where(pixels == -9, np.nan, pixels)
    expected[1] *= 0.5
    expected[2] += 3
    dem = load_geotiff("dem.tif", ["band_3", "band_1", "band_2"])
    for band, layer in enumerate(expected, 1):
        # Rows of a map run to -x, and its columns to -y.
        np.testing.assert_array_equal(dem[f"band_{band}"], layer[:, ::-1].T)


def test_blocks_of_all_bands_are_unpacked_once(rasterio):
    pixels = np.random.default_rng(2).random((512, 512), np.float32)
    options = {"interleave": "pixel", "compress": "deflate", "tiled": True}
    write(rasterio, pixels=pixels, count=8, **options, blockxsize=64, blockysize=64)
    code = (
        "import sys\n"
        "from pathlib import Path\n"
        "from grid_map_core_py.files import _geotiff, load_geotiff\n"
        "def read(): return int(Path('/proc/self/io').read_text().split()[1])\n"
        "load_geotiff('dem.tif', ['band_1'])\n"
        "_geotiff._WINDOW, before = 2**18, read()\n"
        "load_geotiff('dem.tif')\n"
        "print(read() - before)\n"
    )
    environ = {**os.environ, "GDAL_CACHEMAX": "1"}
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, env=environ, capture_output=True, text=True, check=True)
    assert int(done.stdout) < 1.5 * Path("dem.tif").stat().st_size


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


def test_rasters_without_map_are_refused(rasterio):
    turned = rasterio.Affine(2.0, 0.5, 0.0, 0.5, -2.0, 0.0)
    oblong = rasterio.Affine(2.0, 0.0, 0.0, 0.0, -1.0, 0.0)
    for transform in (turned, oblong):
        write(rasterio, transform=transform)
        with pytest.raises(GridMapError, match=r"dem\.tif: cannot be read: expected square pixels"):
            load("dem.tif")
    with pytest.warns(rasterio.errors.NotGeoreferencedWarning):
        write(rasterio, transform=rasterio.Affine.identity())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(GridMapError, match="does not say where it lies"):
            load("dem.tif")
    Path("text.tif").write_text("no raster")
    with pytest.raises(GridMapError, match=r"text\.tif: cannot be read"):
        load("text.tif")
    with pytest.raises(GridMapError, match="no layer 'none'"):
        load(write(rasterio, "good.tif"), layers=["none"])
    write(rasterio, pixels=PIXELS.astype(np.complex64))
    with pytest.raises(GridMapError, match="expected real numbers, got complex64"):
        load("dem.tif")


@pytest.mark.parametrize(
    "form", ["EPSG:25832", "to_wkt", "+proj=utm +zone=32 +ellps=GRS80 +units=m", "EPSG:25832+5783"]
)
def test_reference_system_has_every_form_that_names_no_file(rasterio, form):
    crs = rasterio.crs.CRS.from_epsg(25832)
    save_geotiff(a_map(), "map.tif", crs=getattr(crs, form)() if form == "to_wkt" else form)
    with rasterio.open("map.tif") as raster:
        assert raster.crs.is_projected
        assert raster.crs.linear_units == "metre"


@pytest.mark.usefixtures("rasterio")
@pytest.mark.parametrize("crs", ["{url}", " {url}", "{file}", "+init={file}:1", "+nadgrids={file}"])
def test_reference_system_opens_no_address_and_no_file(crs, tmp_path):
    requests = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            requests.append(self.path)
            self.send_error(404)

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = f"http://127.0.0.1:{server.server_port}/crs"
        with pytest.raises(GridMapError, match="'crs': expected a code such as 'EPSG:25832', WKT"):
            save_geotiff(a_map(), "x.tif", crs=crs.format(url=url, file=tmp_path / "x.wkt"))
        server.shutdown()
    assert not requests


@pytest.mark.usefixtures("rasterio")
def test_a_failed_write_leaves_nothing():
    with pytest.raises(GridMapError, match="has no layers"):
        save(GridMap((1, 1), 0.5), "x.tif")
    with pytest.raises(GridMapError, match=r"x\.tif: cannot be written"):
        save(a_map(), "x.tif", crs="EPSG:nothing")
    assert not list(Path().glob("*x.tif*"))


@pytest.mark.parametrize(
    ("crs", "warning"),
    [
        ("EPSG:4326", "is in degrees, which are taken for meters"),
        ("EPSG:2263", r"is in units of 0.3048006 m \(US survey foot\), which are taken"),
        ("EPSG:25832", ""),
        ('LOCAL_CS["hall",UNIT["metre",1]]', ""),
    ],
)
def test_coordinates_that_are_not_meters_warn(crs, warning, rasterio):
    write(rasterio, crs=crs)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        load("dem.tif")
    assert [bool(warning) for _ in found] == ([True] if warning else [])
    if warning:
        assert found[0].filename == __file__
        with pytest.warns(UserWarning, match=warning):
            load_geotiff("dem.tif")


# --- other files and addresses --------------------------------------------------------------------


@pytest.fixture
def address():
    """Yield the address of a server, and the file of its log."""
    log = Path("requests.log")
    command = (sys.executable, "-u", "-m", "http.server", "0", "--bind", "127.0.0.1")
    # A process of its own, because GDAL holds the lock of the interpreter while it waits.
    with (
        log.open("w") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as server,
    ):
        port = server.stdout.readline().split("port ")[1].split()[0]
        yield f"http://127.0.0.1:{port}", log
        server.kill()


def vrt(source):
    return (
        '<VRTDataset rasterXSize="3" rasterYSize="2"><GeoTransform>0,1,0,0,0,-1</GeoTransform>'
        '<Metadata><MDI key="INTERNAL_MASK_FLAGS_1">2</MDI></Metadata>'
        '<VRTRasterBand dataType="Byte" band="1"><SimpleSource>'
        f'<SourceFilename relativeToVRT="0">{source}</SourceFilename>'
        "<SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
    )


def named_in_metadata(source):
    rasterio = pytest.importorskip("rasterio")
    with rasterio.open("dem.tif", "r+") as raster:
        raster.update_tags(ns="OVERVIEWS", OVERVIEW_FILE=source)


def named_beside(source):
    tag = f'<Metadata domain="OVERVIEWS"><MDI key="OVERVIEW_FILE">{source}</MDI></Metadata>'
    Path("dem.tif.aux.xml").write_text(f"<PAMDataset>{tag}</PAMDataset>")


TRAPS = {
    "a raster that is a VRT": lambda source: Path("dem.tif").write_text(vrt(source)),
    "a mask that is a VRT": lambda source: Path("dem.tif.msk").write_text(vrt(source)),
    "overviews that are a VRT": lambda source: Path("dem.tif.ovr").write_text(vrt(source)),
    "overviews named beside": named_beside,
    "overviews named in metadata": named_in_metadata,
}
"""Each makes GDAL open `source` when it reads dem.tif."""


def read_all(raster):
    with raster:
        raster.overviews(1)
        raster.read(1, out_shape=(1, 1))
        return raster.read(1, masked=True)


@pytest.mark.parametrize("trap", TRAPS)
def test_rasters_open_no_other_file_and_no_address(trap, address, rasterio):
    url, log = address
    write(rasterio)
    TRAPS[trap](f"/vsicurl/{url}/trap.tif")
    # In rasterio 1.3, one is not a class of the other.
    with contextlib.suppress(rasterio.errors.RasterioError, rasterio.errors.RasterioIOError):
        read_all(rasterio.open("dem.tif"))
    assert "/trap.tif" in log.read_text()
    # Another name, because GDAL remembers what it has not found.
    TRAPS[trap](f"/vsicurl/{url}/other.tif")
    if trap in ("overviews that are a VRT", "overviews named beside"):
        np.testing.assert_array_equal(read_all(open_raster("dem.tif")), PIXELS)
        load("dem.tif")
    else:
        with pytest.raises(GridMapError, match=r"dem\.tif: cannot be read: "):
            load("dem.tif")
    assert "/other.tif" not in log.read_text()


@pytest.mark.parametrize(
    "name",
    [
        "/vsicurl/{}/dem.tif",
        "/vsizip/dem.zip/dem.tif",
        "{}/dem.tif",
        "vrt:///vsicurl/{}/dem.tif",
        "GTIFF_DIR:1:/vsicurl/{}/dem.tif",
        "GTIFF_RAW:dem.tif",
        "DERIVED_SUBDATASET:LOGAMPLITUDE:/vsicurl/{}/dem.tif",
    ],
)
def test_rasters_are_paths_of_files(name, address, rasterio):
    url, log = address
    write(rasterio)
    with pytest.raises(GridMapError, match=r"cannot be read: (.*No such file|expected the path)"):
        load(name.format(url))
    assert "GET" not in log.read_text()


def test_virtual_files_are_read_if_asked_for(rasterio):
    with zipfile.ZipFile("dem.zip", "w") as archive:
        archive.write(write(rasterio))
    path = f"/vsizip/{Path('dem.zip').absolute()}/dem.tif"
    assert load(path, virtual=True) == load("dem.tif")


def test_files_beside_a_raster_never_change_values(rasterio):
    with pytest.warns(rasterio.errors.NotGeoreferencedWarning):
        write(rasterio, transform=rasterio.Affine.identity())
    Path("dem.tfw").write_text("2.0\n0\n0\n-2.0\n101.0\n199.0\n")
    assert load("dem.tif").position.tolist() == [103.0, 198.0]
    write(rasterio)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=False), rasterio.open("dem.tif", "r+") as raster:
        raster.write_mask(PIXELS > 2)
    with pytest.raises(GridMapError, match=r"has a mask, .* in dem\.tif\.msk; 'gdal_translate"):
        load("dem.tif")
    Path("dem.tif.msk").unlink()
    beside = Path("dem.tif.aux.xml")
    beside.write_text('<PAMDataset><PAMRasterBand band="1"><NoDataValue>1</NoDataValue>...')
    with pytest.raises(GridMapError, match=r"has a mask, .* in dem\.tif\.aux\.xml"):
        load("dem.tif")
    beside.write_text('<PAMDataset><Metadata><MDI key="STATISTICS_MEAN">2</MDI></Metadata>...')
    assert load("dem.tif")["elevation"].min() == -9


def test_long_files_beside_a_raster_are_not_read_whole(rasterio):
    with pytest.warns(rasterio.errors.NotGeoreferencedWarning):
        write(rasterio, transform=rasterio.Affine.identity())

    def refused(name: str, text: str) -> None:
        Path(name).touch()
        os.truncate(name, 2**27)
        with pytest.raises(GridMapError, match=text):
            load("dem.tif")
        Path(name).unlink()

    for name, text in (
        ("dem.tif.aux.xml", r"expected at most 16777216 bytes in dem\.tif\.aux\.xml"),
        ("dem.tif.msk", r"has a mask"),
        ("dem.tfw", r"cannot be read"),
    ):
        peak, _ = peak_of(refused, name, text)
        assert peak < 50e6, name
