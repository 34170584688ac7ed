# SPDX-License-Identifier: BSD-3-Clause
"""GeoTIFF files as tiled maps, and tiled maps as GeoTIFF files, against rasterio and GDAL."""

import multiprocessing
import os
import pickle
import subprocess
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from memory import peak_of

from grid_map_core_py import GridMapError
from grid_map_core_py.errors import ConfigError, LimitError
from grid_map_core_py.files import load_geotiff
from grid_map_core_py.testing import assert_maps_equal
from grid_map_core_py.tiled import TiledMap, open_map

pytestmark = [pytest.mark.needs("dask", "rasterio"), pytest.mark.usefixtures("in_folder")]

UTM = "EPSG:25832"
RANDOM = np.random.default_rng(16)


def heights(lines: int, pixels: int, bands: int = 1) -> np.ndarray:
    """Return smooth float32 heights with holes, (bands, lines, pixels)."""
    band, line, pixel = np.ogrid[:bands, :lines, :pixels]
    values = 100 + 10 * np.sin(line / 9 + band) * np.cos(pixel / 7) + 0.1 * line
    values[:, lines // 3 : lines // 3 + 3, pixels // 4 : pixels // 2] = np.nan
    return values.astype(np.float32)


def write(name: str, values: np.ndarray, *, scale=None, mask=None, names=None, **options) -> str:
    """Write bands (bands, lines, pixels) as a raster with pixels of 2 m and blocks of 32 pixels."""
    import rasterio

    profile = {
        "driver": "GTiff",
        "dtype": values.dtype,
        "crs": UTM,
        "count": len(values),
        "height": values.shape[1],
        "width": values.shape[2],
        "tiled": True,
        "blockxsize": 32,
        "blockysize": 32,
        "transform": rasterio.Affine(2.0, 0.0, 691_000.0, 0.0, -2.0, 5_335_000.0),
        **options,
    }
    if not profile["transform"]:
        del profile["transform"]
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(name, "w", **profile) as raster:
        raster.write(values)
        if scale:
            raster.scales, raster.offsets = ([one] * len(values) for one in scale)
        if mask is not None:
            raster.write_mask(mask)
        if names:
            raster.descriptions = names
    return name


def integers(kind: str, bands: int = 1) -> np.ndarray:
    return RANDOM.integers(0, 100, (bands, 83, 71)).astype(kind)


RASTERS = {
    "float32": lambda: write("a.tif", heights(83, 71)),
    "float32, no data": lambda: write(
        "a.tif", np.nan_to_num(heights(83, 71), nan=-9999), nodata=-9999
    ),
    "int16": lambda: write("a.tif", integers("int16") - 50, nodata=-9, scale=(0.1, 20.0)),
    "uint8, alpha": lambda: write("a.tif", integers("uint8", 4), photometric="RGB", alpha="YES"),
    "float64": lambda: write("a.tif", integers("float64") / 3, nodata=1.0, compress="deflate"),
    "a mask": lambda: write("a.tif", integers("uint16"), mask=RANDOM.random((83, 71)) > 0.2),
    "bands": lambda: write(
        "a.tif", heights(83, 71, 3), interleave="pixel", names=("elevation", "slope", "b")
    ),
    "strips": lambda: write(
        "a.tif", heights(83, 71), tiled=False, blockysize=5, compress="deflate"
    ),
    "one cell": lambda: write("a.tif", heights(1, 1)),
}


@pytest.mark.parametrize("kind", RASTERS)
def test_windows_equal_reading_of_rasterio(kind):
    import rasterio

    site = open_map(RASTERS[kind](), chunks=23)
    with rasterio.open("a.tif") as raster:
        pixels = raster.read(masked=True)
        scale = np.array([raster.scales, raster.offsets])[..., None, None]
        expected = pixels.astype(np.float64).filled(np.nan) * scale[0] + scale[1]
        expected = expected.astype(np.float32)
        left, bottom, right, top = raster.bounds
    assert site.position.tolist() == [(left + right) / 2, (bottom + top) / 2]
    assert site.length.tolist() == [right - left, top - bottom]
    rows, columns = site.size
    assert_maps_equal(site.to_map(), load_geotiff("a.tif"))
    windows = [*site.tiles, (slice(0, rows), slice(0, columns))]
    windows += [(slice(rows // 5, rows // 5 + 1), slice(columns // 2, columns))]
    for window in windows:
        read = site.source.read(window, site.layers)
        for layer, band in zip(read, expected, strict=True):
            assert layer.flags.f_contiguous
            assert (layer.dtype, layer.base) == (np.float32, None)
            # Rows of a map run to -x, and its columns to -y.
            np.testing.assert_array_equal(layer, band[:, ::-1].T[window])


# --- large, damaged and changed rasters -----------------------------------------------------------


def empty_raster(name: str, cells: int, bigtiff: str = "NO"):
    """Open a new raster without values, whose blocks take no space."""
    import rasterio

    profile = {"driver": "GTiff", "dtype": "float32", "count": 1, "crs": UTM, "sparse_ok": True}
    profile |= {"width": cells, "height": cells, "tiled": True, "transform": moved(0)}
    return rasterio.open(name, "w", bigtiff=bigtiff, nodata=np.nan, **profile)


def test_rasters_of_any_size_are_opened(grid_map_command):
    from rasterio.windows import Window

    with empty_raster("a.tif", 100_000, "YES") as raster:
        raster.write(heights(10, 20), window=Window(70_000, 30_000, 20, 10))
    site = open_map("a.tif")
    assert site.size == (100_000, 100_000)
    # Pixel 70,003 of line 30,002 is row 99,999 - 70,003.
    found = site.get_block(slice(29_990, 30_010), slice(29_999, 30_020))["elevation"]
    np.testing.assert_array_equal(found[6, 3], heights(10, 20)[0, 2, 3])
    assert np.isfinite(found).sum() == np.isfinite(heights(10, 20)[0, :, :10]).sum()
    with pytest.raises(LimitError, match="max_cells"):
        site.to_map()
    peak, (code, output, _) = peak_of(grid_map_command, "info a.tif")
    assert code == 0
    assert "size      100000 x 100000 cells of 2 m" in output
    assert peak < 20e6


def test_damaged_block_is_one_error_that_names_the_file(capfd):
    write("a.tif", RANDOM.random((1, 100, 100), np.float32), compress="deflate")
    data = bytearray(Path("a.tif").read_bytes())
    data[len(data) // 2 : -len(data) // 3] = bytes(len(data) // 6 + 1)
    Path("a.tif").write_bytes(data)
    site = open_map("a.tif", chunks=32)
    with pytest.raises(GridMapError, match=r"a\.tif: cannot be read: .+"):
        site.to_map()
    with pytest.raises(GridMapError, match=r"a\.tif: cannot be read: .+"):
        site.to_geotiff("b.tif")
    assert {path.name for path in Path().iterdir()} == {"a.tif"}
    assert "ERROR" not in capfd.readouterr().err


def test_changed_raster_is_read_again():
    open_map(write("a.tif", heights(20, 30))).to_map()
    write("a.tif", heights(10, 30) + 1)
    assert_maps_equal(open_map("a.tif").to_map(), load_geotiff("a.tif"))
    Path("a.tif").unlink()
    with pytest.raises(GridMapError, match=r"a\.tif: cannot be read: .*No such file"):
        open_map("a.tif")


# --- processes and threads ------------------------------------------------------------------------


def mean_of(pickled: bytes) -> float:
    site = pickle.loads(pickled)
    return float(np.nanmean(site.to_map()[site.layers[0]]))


@pytest.mark.parametrize("method", ["spawn", "fork"])
@pytest.mark.filterwarnings("ignore:This process")
def test_other_processes_read_pickled_maps(method):
    write("a.tif", heights(83, 71))
    sites = [open_map("a.tif"), open_map("a.tif", crs="EPSG:32633")]
    pickled = [pickle.dumps(site) for site in sites]
    expected = [mean_of(one) for one in pickled]
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        assert [*pool.map(mean_of, pickled, timeout=60)] == expected
    # The child has left the open file alone.
    assert [mean_of(one) for one in pickled] == expected


def test_threads_read_at_once():
    site = open_map(write("a.tif", heights(300, 280), compress="deflate"))
    expected = site.to_map()["elevation"]

    def check(seed: int) -> None:
        for row, column in np.random.default_rng(seed).integers(0, 200, (40, 2)):
            window = slice(row, row + 57), slice(column, column + 41)
            (found,) = site.source.read(window, site.layers)
            np.testing.assert_array_equal(found, expected[window])

    with ThreadPoolExecutor(4) as pool:
        assert len([*pool.map(check, range(4))]) == 4


# --- mosaics --------------------------------------------------------------------------------------


def moved(pixels: float, lines: float = 0.0, step: float = 2.0):
    """Return the place of a raster that is moved to the east and to the south."""
    from rasterio import Affine

    return Affine(step, 0.0, 691_000.0 + 2.0 * pixels, 0.0, -step, 5_335_000.0 - 2.0 * lines)


@pytest.mark.parametrize("chunks", [7, 100])
def test_first_value_of_a_mosaic_wins(chunks):
    whole = np.full((60, 90), np.nan, np.float32)
    places = [(20, 10), (0, 5), (45, 30), (30, 20)]
    paths = []
    for number, (left, top) in enumerate(places):
        values = RANDOM.random((1, 25, 40), np.float32) + number
        values[RANDOM.random(values.shape) < 0.4] = np.nan
        paths.append(write(f"{number}.tif", values, transform=moved(left, top)))
        part = whole[top : top + 25, left : left + 40]
        part[np.isnan(part)] = values[0][np.isnan(part)]
    site = open_map(paths, chunks=chunks)
    expected = whole[5:55, 0:85]
    assert site.size == (85, 50)
    for window in site.tiles:
        (found,) = site.source.read(window, ["elevation"])
        np.testing.assert_array_equal(found, expected[:, ::-1].T[window])
    # The north-west corner of the mosaic is that of its pixels.
    corner = site.position + [-0.5, 0.5] * site.length
    assert corner.tolist() == [691_000.0, 5_335_000.0 - 2 * 5]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"crs": "EPSG:32632"},
            "expected the reference system of a.tif, EPSG:25832, got EPSG:32632",
        ),
        ({"crs": None}, "expected the reference system of a.tif, EPSG:25832, got none"),
        ({"transform": (4, 0, 2.5)}, "expected the pixels of a.tif, 2, got 2.5"),
        ({"transform": (4.3, 2.0)}, r"grid of a.tif, got ones that are shifted by \(0.3, .*0\)"),
        ({"names": ["slope"]}, "expected the layers of a.tif, elevation, got slope"),
        ({"transform": None}, "has no position"),
    ],
)
@pytest.mark.filterwarnings("ignore:Dataset has no")
@pytest.mark.filterwarnings("ignore:.*geotransform")
def test_raster_that_differs_is_one_error_that_names_it(changes, message):
    if changes.get("transform"):
        changes = {"transform": moved(*changes["transform"])}
    write("a.tif", heights(5, 5))
    write("b.tif", heights(5, 5), transform=moved(5))
    write("c.tif", heights(5, 5), **{"transform": moved(10), **changes})
    with pytest.raises(GridMapError, match=r"^c\.tif: cannot be read: .*" + message):
        open_map(["a.tif", "b.tif", "c.tif"])


# --- reference systems ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("transform", "side"),
    [
        ((2, 0.5, 0, 0.5, -2, 0), "2.06155281281"),
        ((2, 0, 0, 0, -1, 0), "1.41421356237"),
        ((2, 0, 0, 0, 2, 0), "2"),
    ],
)
def test_other_rasters_are_refused_with_the_line_that_mends_them(transform, side):
    from rasterio import Affine

    write("my dem.tif", heights(5, 5), transform=Affine(*transform))
    line = f"gdalwarp -r bilinear -tr {side} {side} 'my dem.tif' 'my dem_north_up.tif'"
    for read in (open_map, load_geotiff):
        with pytest.raises(
            GridMapError, match=r"^my dem\.tif: .*got .*; to fix this, run: " + line
        ):
            read("my dem.tif")


def test_projected_raster_equals_warping_of_the_whole():
    from rasterio.warp import Resampling, reproject

    smooth = heights(200, 230)
    write("a.tif", smooth, nodata=np.nan)
    site = open_map("a.tif", crs="EPSG:32633", chunks=64)
    assert site.crs.startswith('PROJCS["WGS 84 / UTM zone 33N"')
    rows, columns = site.size
    expected = np.full((columns, rows), np.nan, np.float32)
    west, north = site.position + [-0.5, 0.5] * site.length
    step = site.resolution
    from rasterio import Affine

    reproject(
        smooth[0],
        expected,
        src_transform=moved(0),
        src_crs=UTM,
        dst_transform=Affine(step, 0, west, 0, -step, north),
        dst_crs="EPSG:32633",
        src_nodata=np.nan,
        dst_nodata=np.nan,
        resampling=Resampling.bilinear,
    )
    whole = site.to_map()["elevation"]
    np.testing.assert_allclose(whole, expected[:, ::-1].T, atol=0.02)
    assert 0.5 < np.isfinite(whole).mean() < 1.0
    for window in site.tiles:
        (found,) = site.source.read(window, site.layers)
        np.testing.assert_array_equal(found, whole[window])


def test_projected_bands_keep_their_own_holes_scale_and_mask():
    from rasterio.warp import transform

    line, pixel = np.mgrid[:120, :120]
    values = np.stack([line, pixel]).astype(np.int16)
    values[0, 40:60, 40:60] = values[1, 70:90, 70:90] = -9
    write("a.tif", values, nodata=-9, scale=(0.5, 100.0))
    site = open_map("a.tif", crs="EPSG:32633").to_map()
    for x, y, expected in (
        (50.5, 50.5, (np.nan, 125)),
        (80.5, 80.5, (140, np.nan)),
        (20.5, 100.5, (150, 110)),
    ):
        # The center of pixel (x, y) of the raster.
        (east,), (north,) = transform(UTM, "EPSG:32633", [691_000 + 2 * x], [5_335_000 - 2 * y])
        found = [site.at_position(name, (east, north)) for name in site.layers]
        np.testing.assert_allclose(found, expected, atol=0.8)
    write("b.tif", values[:1].astype(np.float32), mask=pixel < 60)
    masked = open_map("b.tif", crs="EPSG:32633").to_map()["elevation"]
    assert 0.3 < np.isfinite(masked).mean() < 0.5


def test_projected_rasters_make_a_mosaic():
    values = heights(80, 120)
    write("a.tif", values)
    whole = open_map("a.tif", crs="EPSG:32633").to_map()
    write("left.tif", values[..., :70])
    write("right.tif", values[..., 50:], transform=moved(50))
    site = open_map(["left.tif", "right.tif"], crs="EPSG:32633", chunks=50)
    found = site.to_map()
    assert found.resolution == pytest.approx(whole.resolution, rel=1e-4)
    positions = whole.position + RANDOM.uniform(-60, 60, (200, 2))
    one, other = (each.at_position("elevation", positions, "linear") for each in (whole, found))
    both = np.isfinite(one) & np.isfinite(other)
    assert both.sum() > 100
    np.testing.assert_allclose(one[both], other[both], atol=0.5)


def test_degrees_warn_and_say_what_projects_them():
    from rasterio import Affine

    write("a.tif", heights(5, 5), crs="EPSG:4326", transform=Affine(1e-5, 0, 11.5, 0, -1e-5, 48.1))
    with pytest.warns(UserWarning, match="are treated as meters; .*crs='EPSG:32632'") as found:
        open_map("a.tif")
    assert found[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        site = open_map("a.tif", crs="EPSG:32632")
    assert 0.7 < site.resolution < 1.2
    with pytest.raises(GridMapError, match=r"crs: expected a reference system in meters, got degr"):
        open_map("a.tif", crs="EPSG:4326")


def test_wide_strips_warn_and_say_what_mends_them():
    strips = {"tiled": False, "blockysize": 1}
    write("a.tif", np.zeros((1, 4, 9000), np.float32), compress="deflate", **strips)
    line = "gdal_translate -co TILED=YES -co BIGTIFF=IF_SAFER a.tif a_tiled.tif"
    with pytest.warns(UserWarning, match=f"in strips of 9000 pixels, .*; to fix this, run: {line}"):
        open_map("a.tif")
    write("a.tif", np.zeros((1, 4, 9000), np.float32), **strips)
    open_map("a.tif")


def test_wrong_arguments_are_refused(capfd):
    write("a.tif", heights(5, 5), crs=None)
    with pytest.raises(GridMapError, match=r"a\.tif: .*has no reference system from which EPSG:4"):
        open_map("a.tif", crs="EPSG:4326")
    with pytest.raises(ConfigError, match=r"crs: expected WKT, a code .*, got 'EPSG:9999999'"):
        open_map(write("b.tif", heights(5, 5)), crs="EPSG:9999999")
    assert not capfd.readouterr().err  # PROJ prints no message of its own
    with pytest.raises(ConfigError, match="path"):
        open_map([])
    path = f"/vsisubfile/0_{Path('a.tif').stat().st_size},{Path('a.tif').absolute()}"
    assert_maps_equal(open_map([path]).to_map(), open_map("a.tif").to_map())


# --- writing --------------------------------------------------------------------------------------


def a_site(lines: int = 700, pixels: int = 1100, bands: int = 2, **options) -> TiledMap:
    return open_map(write("in.tif", heights(lines, pixels, bands)), chunks=300, **options)


@pytest.mark.needs("rio_cogeo")
@pytest.mark.parametrize("compress", [True, False])
@pytest.mark.parametrize("bands", [1, 3])
def test_written_cog_is_valid_and_has_all_values(bands, compress):
    import rasterio
    from rio_cogeo.cogeo import cog_validate

    site = a_site(bands=bands)
    site.to_geotiff("out.tif", compress=compress)
    assert {path.name for path in Path().iterdir()} == {"in.tif", "out.tif"}
    assert cog_validate("out.tif", strict=True, quiet=True) == (True, [], [])
    with rasterio.open("in.tif") as before, rasterio.open("out.tif") as after:
        np.testing.assert_array_equal(after.read(), before.read())
        assert (after.transform, after.crs) == (before.transform, before.crs)
        assert after.overviews(1) == [2, 4]
        assert np.isnan(after.nodata)
    assert_maps_equal(load_geotiff("out.tif"), load_geotiff("in.tif"))


def test_overviews_are_means_of_finite_cells():
    import rasterio

    values = heights(1024, 1024)
    values[0, RANDOM.random((1024, 1024)) < 0.3] = np.nan
    open_map(write("in.tif", values)).to_geotiff("out.tif")
    with rasterio.open("out.tif", overview_level=0) as raster:
        found = raster.read(1)
    quarters = values[0].reshape(512, 2, 512, 2).swapaxes(1, 2).reshape(512, 512, 4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = np.nanmean(quarters, axis=-1)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("cog", [True, False])
@pytest.mark.parametrize("size", [(1, 1), (513, 1025)])
def test_map_round_trips(size, cog):
    site = open_map(write("in.tif", heights(*size, 2)), chunks=200)
    site = TiledMap(
        site.source,
        site.geometry,
        site.tile,
        frame_id="odom",
        timestamp=3_000_000_007,
        basic_layers=("band_2",),
        crs=site.crs,
    )
    calls = []
    site.to_geotiff("out.tif", cog=cog, progress=lambda *counts: calls.append(counts))
    assert_maps_equal(open_map("out.tif").to_map(), site.to_map())
    assert_maps_equal(load_geotiff("out.tif"), site.to_map())
    assert open_map("out.tif").crs == site.crs
    assert calls == [(n, calls[-1][1]) for n in range(calls[-1][1] + 1)]
    site.to_geotiff("out.tif", cog=cog, layers=["band_1"], overwrite=True)
    back = open_map("out.tif")
    assert (back.layers, back.basic_layers) == (("band_1",), ())


@pytest.mark.needs("distributed")
def test_map_is_computed_by_cluster_in_another_folder(cluster):
    with cluster.as_current():
        a_site().to_geotiff("out.tif")
    assert_maps_equal(load_geotiff("out.tif"), load_geotiff("in.tif"))


def test_replaced_raster_must_be_opened_again():
    site = a_site(20, 30)
    assert site.to_map().size == (30, 20)
    write("in.tif", heights(20, 30, 1))
    with pytest.raises(GridMapError, match=r"in\.tif: the file has been replaced"):
        site.to_map()


def test_existing_file_is_replaced_only_on_request():
    site = a_site(20, 30)
    Path("out.tif").write_text("precious")
    with pytest.raises(GridMapError, match=r"^out\.tif: .*already exists; 'overwrite' replaces it"):
        site.to_geotiff("out.tif")
    assert Path("out.tif").read_text() == "precious"
    site.to_geotiff("out.tif", overwrite=True)
    assert_maps_equal(load_geotiff("out.tif"), load_geotiff("in.tif"))
    with pytest.raises(GridMapError, match=r"out\.npz: expected a name that ends in \.tif"):
        site.to_geotiff("out.npz")


@pytest.mark.parametrize("cog", [True, False])
@pytest.mark.parametrize("share", [0.001, 0.99])
def test_full_disk_is_one_error_and_leaves_nothing(share, cog, full_disk):
    values = RANDOM.random((1, 1000, 1100), np.float32)
    site = open_map(write("in.tif", values))
    site.to_geotiff("out.tif", cog=cog)
    length = Path("out.tif").stat().st_size
    before = Path("out.tif").read_bytes()
    with (
        full_disk(int(share * length)),
        pytest.raises(GridMapError, match=r"^out\.tif: cannot be written: "),
    ):
        site.to_geotiff("out.tif", cog=cog, overwrite=True)
    assert {path.name for path in Path().iterdir()} == {"in.tif", "out.tif"}
    assert Path("out.tif").read_bytes() == before


def test_memory_of_writing_does_not_grow_with_the_map():
    code = (
        "import resource\n"
        "from grid_map_core_py.tiled import open_map\n"
        "for name in 'small.tif', 'large.tif':\n"
        "    open_map(name, chunks=512).to_geotiff('out.tif', compress=False, overwrite=True)\n"
        "    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)\n"
    )
    # The layers have 16 MB and 100 MB.
    empty_raster("small.tif", 2000).close()
    empty_raster("large.tif", 5000).close()
    options = {"env": {**os.environ, "GDAL_CACHEMAX": "20"}, "check": True, "text": True}
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, **options)
    small, large = map(int, done.stdout.split())
    assert large - small < 40_000
