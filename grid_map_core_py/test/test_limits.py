# SPDX-License-Identifier: BSD-3-Clause
"""Small inputs that claim much are refused before they take memory; limits can be raised."""

import os
import struct
import threading
import time
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from grid_map_core_py import (
    ConfigError,
    GridMap,
    GridMapError,
    LimitError,
    from_mesh,
    from_points,
    load,
)
from grid_map_core_py.conversions import rasterize_triangles
from grid_map_core_py.files import (
    _geotiff,
    _tiff,
    load_height_image,
    load_points,
    save_images,
    save_npz,
)
from grid_map_core_py.limits import Limits, changed_limits, current_limits, set_limits
from grid_map_core_py.map import select_layers

Bomb = Callable[[Path], Any]
CORNERS = [(0.0, 0.0, 0.0), (8000.0, 8000.0, 1.0)]
"""Points 11 km apart."""


def chunk(kind: bytes, content: bytes) -> bytes:
    checksum = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)


def png(path: Path, side: int = 30_000) -> Path:
    """Write a black image of a few kilobytes, whose pixels take `side` * `side` bytes."""
    head = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    packer = zlib.compressobj(9)
    data = b"".join(packer.compress(bytes(side + 1)) for _ in range(side)) + packer.flush()
    parts = chunk(b"IHDR", head), chunk(b"IDAT", data), chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))
    return path


def tiff(path: Path, order: str, *, big: bool, kind: int = 4) -> Path:
    """Write the head of an image of 30,000 x 30,000 pixels, in one of the four forms of TIFF."""
    mark = {"<": b"II", ">": b"MM"}[order]
    form = (43, 8, 0, 16, 2) if big else (42, 8, 2)
    head = mark + struct.pack(order + ("HHHQQ" if big else "HIH"), *form)
    entry = "HHQI4x" if big else "HHII"
    sides = [struct.pack(order + entry, tag, kind, 1, 30_000) for tag in (256, 257)]
    path.write_bytes(head + b"".join(sides) + bytes(8))
    return path


def image(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def nav2(folder: Path) -> Path:
    document = {"image": "map.png", "resolution": 0.1, "origin": [0.0, 0.0, 0.0]}
    document |= {"occupied_thresh": 0.65, "free_thresh": 0.2}
    (folder / "nav2.yaml").write_text(yaml.safe_dump(document))
    png(folder / "map.png")
    return folder / "nav2.yaml"


def folder_of_images(folder: Path) -> Path:
    path = save_images(GridMap((1, 1), 0.5, layers={"a": 1.0}), folder / "images")
    path.write_text(path.read_text().replace("- 2\n", "- 30000\n"))
    return path


def npz_without_layers(folder: Path) -> Path:
    """Write the metadata of a map of 30,000 x 30,000 cells."""
    save_npz(GridMap((1, 1), 0.5), folder / "small.npz")
    with zipfile.ZipFile(folder / "small.npz") as archive:
        data = archive.read("metadata.npy")
    text = '"size": [2, 2]'.encode("utf-32-le"), '"size": [30000, 30000]'.encode("utf-32-le")
    longer = (len(text[1]) - len(text[0])) // 4
    length = len(data[128:]) // 4
    data = data.replace(*text).replace(b"<U%d" % length, b"<U%d" % (length + longer))
    with zipfile.ZipFile(folder / "large.npz", "w") as archive:
        archive.writestr("metadata.npy", data)
    return folder / "large.npz"


def tiled_geotiff(folder: Path, side: int, **shape: Any) -> Path:
    """Write a small raster whose only tiles are large."""
    return sparse_geotiff(folder, **{"width": side, "height": side, "blockysize": 16, **shape})


def sparse_geotiff(folder: Path, **shape: Any) -> Path:
    rasterio = pytest.importorskip("rasterio")

    profile = {"driver": "GTiff", "dtype": "float32", "tiled": True, "SPARSE_OK": True}
    profile |= {"width": 30_000, "height": 30_000, "count": 1, **shape}
    transform = rasterio.transform.from_origin(0, 0, 1, 1)
    with rasterio.open(folder / "sparse.tif", "w", transform=transform, **profile):
        pass
    return folder / "sparse.tif"


CELLS = "expected at most 16000000 cells, got "
SQUARE = CELLS + "30000 x 30000"

BOMBS: dict[str, tuple[Bomb, str]] = {
    "points": (lambda _: from_points(CORNERS, 0.1), CELLS + "80001 x 80001"),
    "many fields": (
        lambda _: from_points(CORNERS, 4.0, fields={f"f{n}": [0, 0] for n in range(500)}),
        "expected at most 4000000000 bytes, got 501 layers of 16016004 bytes",
    ),
    "mesh": (lambda _: from_mesh([*CORNERS, (0, 1, 0)], [[0, 1, 2]], 0.1), CELLS),
    "PNG": (lambda folder: load(png(folder / "a.png"), resolution=1.0), SQUARE),
    "TIFF": (lambda folder: load(tiff(folder / "a.tif", "<", big=False), resolution=1.0), SQUARE),
    "TIFF >": (lambda folder: load(tiff(folder / "a.tif", ">", big=False), resolution=1.0), SQUARE),
    "signed TIFF": (
        lambda folder: load(tiff(folder / "a.tif", "<", big=False, kind=9), resolution=1.0),
        SQUARE,
    ),
    "BigTIFF": (lambda folder: load(tiff(folder / "a.tif", ">", big=True), resolution=1.0), SQUARE),
    "BMP": (
        lambda folder: load(
            image(folder / "a.bmp", b"BM" + struct.pack("<12xIii", 40, 30_000, -30_000)),
            resolution=1.0,
        ),
        SQUARE,
    ),
    "old BMP": (
        lambda folder: load(
            image(folder / "a.bmp", b"BM" + struct.pack("<12xIHH", 12, 30_000, 30_000)),
            resolution=1.0,
        ),
        SQUARE,
    ),
    "PGM": (
        lambda folder: load(
            image(folder / "a.pgm", b"P5\n# comment\n30000 30000\n255\n"), resolution=1.0
        ),
        SQUARE,
    ),
    "map_server": (lambda folder: load(nav2(folder)), SQUARE),
    "images": (lambda folder: load(folder_of_images(folder)), SQUARE),
    "npz": (lambda folder: load(npz_without_layers(folder)), SQUARE),
    "GeoTIFF": (lambda folder: load(sparse_geotiff(folder)), SQUARE),
    "bands of a GeoTIFF": (
        lambda folder: load(sparse_geotiff(folder, width=4000, height=4000, count=9)),
        "expected at most 1100 bytes from one byte, got 576000000 unpacked from",
    ),
    "tile of a GeoTIFF": (
        lambda folder: load(tiled_geotiff(folder, 16, blockxsize=16384, blockysize=32752)),
        "tile: " + CELLS + "32752 x 16384",
    ),
    "tile of a TIFF": (
        lambda folder: load_height_image(
            tiled_geotiff(folder, 16, blockxsize=16384, blockysize=32752), resolution=1.0
        ),
        "tile: " + CELLS + "32752 x 16384",
    ),
    "tiles of a GeoTIFF": (
        lambda folder: load(tiled_geotiff(folder, 500, width=16, blockxsize=1_000_000)),
        "tiles: expected at most 16000000 times ",
    ),
    "tiles of a virtual GeoTIFF": (
        lambda folder: load(
            tiled_geotiff(folder, 500, width=16, blockxsize=1_000_000), virtual=True
        ),
        "tiles: expected at most 16000000 times ",
    ),
    "bands in the tile of a GeoTIFF": (
        lambda folder: load(
            tiled_geotiff(folder, 16, count=9, interleave="pixel", blockxsize=4000, blockysize=4000)
        ),
        "block: expected at most 1100 bytes from one byte, got 576000000 unpacked from",
    ),
}


NEEDS = [pytest.mark.needs("rasterio")]


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=NEEDS * ("tile" in kind or "GeoTIFF" in kind)) for kind in BOMBS],
)
def test_small_input_cannot_claim_much(kind, tmp_path):
    read, text = BOMBS[kind]
    tracemalloc.start()
    try:
        with pytest.raises(LimitError, match=text):
            read(tmp_path)
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("ending", ["png", "tif", "bmp", "pgm", "ppm", "pbm", "jpg"])
def test_size_is_read_from_the_head_of_images(ending, tmp_path):
    path = tmp_path / f"a.{ending}"
    cv2.imwrite(str(path), np.zeros((20, 30, 3 if ending == "ppm" else 1), np.uint8))
    with changed_limits(max_cells=600):
        assert load_height_image(path, resolution=1.0).size == (30, 20)
    with changed_limits(max_cells=599), pytest.raises(LimitError, match="got 20 x 30"):
        load_height_image(path, resolution=1.0)


def test_jpeg_of_many_scans_is_refused(tmp_path):
    path, options = tmp_path / "a.jpg", [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]
    cv2.imwrite(str(path), np.eye(40, dtype=np.uint8) * 255, options)
    assert load_height_image(path, resolution=1.0).size == (40, 40)
    data = path.read_bytes()
    begin = data.rindex(b"\xff\xda")
    path.write_bytes(data[:begin] + data[begin:-2] * 100 + data[-2:])
    with pytest.raises(GridMapError, match="a JPEG image of more than 100 scans"):
        load_height_image(path, resolution=1.0)


@pytest.mark.needs("rasterio")
def test_small_map_in_large_tile_of_mask_is_refused(tmp_path):
    path = tiled_geotiff(tmp_path, 16, blockxsize=16)
    data = bytearray(path.read_bytes())
    # A second directory: a mask of the same size, whose tile is large.
    (start,) = struct.unpack_from("<I", data, 4)
    (count,) = struct.unpack_from("<H", data, start)
    struct.pack_into("<I", data, start + 2 + 12 * count, len(data))
    tags = {254: 4, 256: 16, 257: 16, 322: 16384, 323: 32752}
    entries = [struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags.items()]
    path.write_bytes(bytes(data) + struct.pack("<H", len(tags)) + b"".join(entries) + bytes(4))
    with pytest.raises(LimitError, match=f"tile: {CELLS}32752 x 16384"):
        load(path)


def test_tiff_shortened_while_read_ends_no_process(tmp_path, monkeypatch):
    path = tmp_path / "a.tif"
    cv2.imwrite(str(path), np.zeros((20, 30), np.uint8))
    data = bytearray(path.read_bytes())
    (start,) = struct.unpack_from("<I", data, 4)
    (count,) = struct.unpack_from("<H", data, start)
    struct.pack_into("<I", data, start + 2 + 12 * count, 2**20)
    path.write_bytes(data)
    os.truncate(path, 2**21)
    checked = []

    def shorten(*arguments, **_options):
        os.truncate(path, len(data))
        checked.append(arguments[1])

    monkeypatch.setattr(_tiff, "check_tiles", shorten)
    assert _geotiff._checked_length(path) == 2**21
    assert checked == [(20, 30)]


@pytest.mark.needs("pypcd4")
@pytest.mark.parametrize(
    ("claim", "form", "data"),
    [
        *product(["COUNT 1 1 1000000000", "POINTS 1000000000"], ["ascii", "binary"], [""]),
        ("POINTS 1000000000", "binary_compressed", "\0" * 8),
        # The sizes of the packed and the unpacked points.
        ("POINTS 1", "binary_compressed", f"1234{chr(0) * 4}"),
        ("POINTS 1", "binary_compressed", f"{chr(0) * 4}1234"),
    ],
)
def test_pcd_claiming_gigabytes_is_refused(claim, form, data, tmp_path):
    lines = ["FIELDS x y z", "SIZE 4 4 4", "TYPE F F F", "COUNT 1 1 1", "WIDTH 1", "HEIGHT 1"]
    lines = [*lines, "POINTS 1"]
    name = claim.partition(" ")[0]
    lines = [claim if line.startswith(name) else line for line in lines]
    path = tmp_path / "a.pcd"
    path.write_text("\n".join([*lines, f"DATA {form}", data, ""]))
    with pytest.raises(GridMapError, match="more than it has"):
        load_points(path)


@pytest.mark.parametrize("ending", ["pgm", "pcd", "ply"])
@pytest.mark.needs("pypcd4", "trimesh")
def test_files_beyond_the_limit_are_not_read(ending, tmp_path):
    path = tmp_path / f"a.{ending}"
    path.write_bytes(bytes(1001))
    text = "file: expected at most 1000 bytes, got 1001"
    with changed_limits(max_bytes=1000), pytest.raises(LimitError, match=text):
        load(path, resolution=1.0)


@pytest.mark.needs("pypcd4")
def test_pcd_claiming_more_than_the_limit_is_refused(tmp_path):
    lines = ["FIELDS x y z", "SIZE 4 4 4", "TYPE F F F", "COUNT 1 1 1", "WIDTH 1", "HEIGHT 1"]
    (tmp_path / "a.pcd").write_text("\n".join([*lines, "POINTS 100", "DATA ascii", ""]))
    text = "points: expected at most 1000 bytes, got 1200"
    with changed_limits(max_bytes=1000), pytest.raises(LimitError, match=text):
        load_points(tmp_path / "a.pcd")


def test_maps_made_in_python_have_no_limit():
    grid_map = GridMap((5000, 5000), 1.0)
    with changed_limits(max_cells=1):
        assert from_points(CORNERS, 1000.0, length=(9000, 9000)).size == (9, 9)
        grid_map.extend_to_include(GridMap((1, 1), 1.0, position=(2500, 0)))
    assert grid_map.size == (5001, 5000)


def test_mesh_of_many_large_triangles_is_refused_at_once():
    corners = [(-9, -9, 0), (9, -9, 0), (0, 9, 1)]
    many = np.zeros((5_000_000, 3), np.int32) + np.arange(3)
    grid_map = GridMap((10, 10), 0.1)
    text = "faces: expected at most 16000000 times 4 cells under all of them, got 81920000"
    with pytest.raises(LimitError, match=text):
        rasterize_triangles(corners, many, grid_map)
    with changed_limits(max_cells=10_000):
        # Those beside the map, and those of no size, cost nothing.
        beside = np.add(corners, (50, 0, 0))
        faces = np.vstack([many[:9] + 3, many[:9] * 0])
        rasterize_triangles([*corners, *beside], faces, grid_map)
        rasterize_triangles(corners, many[:4], grid_map)
        with pytest.raises(LimitError, match="got 50000"):
            rasterize_triangles(corners, many[:5], grid_map)


def test_many_needles_of_little_area_are_refused():
    corners = [(-5, 0.05, 0), (5, 0.05, 0), (5, 0.0500001, 1)]
    many = np.zeros((1000, 3), np.int32) + np.arange(3)
    with changed_limits(max_cells=10_000), pytest.raises(LimitError, match="got 100000"):
        rasterize_triangles(corners, many, GridMap((10, 10), 0.1))


def test_limits_are_raised_for_a_block_or_for_good():
    with changed_limits(max_cells=80001**2, max_bytes=1e9):
        with pytest.raises(LimitError, match="expected at most 1000000000 bytes"):
            from_points(CORNERS, 0.1)
        before = set_limits(max_ratio=3, max_bytes=2e9)
        try:
            assert before == Limits()
            assert current_limits() == Limits(80001**2, 1e9, 3)
            with changed_limits(max_bytes=5):
                assert current_limits() == Limits(80001**2, 5, 3)
        finally:
            assert set_limits(before) == Limits(max_bytes=2e9, max_ratio=3)
    assert current_limits() == Limits()


def test_overlapping_blocks_change_their_own_thread_only():
    first, second = threading.Event(), threading.Event()

    def leave_while_the_other_is_inside() -> Limits:
        with changed_limits(max_cells=1e12):
            first.set()
            assert second.wait(60)
        return current_limits()

    with ThreadPoolExecutor(1) as pool:
        leaving = pool.submit(leave_while_the_other_is_inside)
        assert first.wait(60)
        assert current_limits() == Limits()
        with changed_limits(max_cells=10):
            second.set()
            assert leaving.result() == Limits()
            assert current_limits() == Limits(10)
            assert pool.submit(current_limits).result() == Limits()
    assert current_limits() == Limits()


def test_limits_of_the_process_hold_in_all_threads():
    before = set_limits(max_cells=7)
    try:
        with ThreadPoolExecutor(1) as pool:
            assert pool.submit(current_limits).result() == Limits(7)
    finally:
        set_limits(before)


@pytest.mark.parametrize("value", [0, -1, np.nan, np.inf, "many", None])
def test_invalid_limit_is_refused(value):
    with pytest.raises(ConfigError, match="'max_cells': expected a finite number of at least 1"):
        set_limits(max_cells=value)
    with pytest.raises(ConfigError), changed_limits(max_cells=value):
        pass
    assert current_limits() == Limits()


def test_commands_have_options_that_change_limits(grid_map_command, tmp_path):
    save_npz(GridMap((5, 5), 1.0, layers={"a": 1.0}), tmp_path / "a.npz")
    code, _, error = grid_map_command("convert a.npz b.npz --max-cells 24")
    assert (code, "map: expected at most 24 cells, got 5 x 5" in error) == (1, True)
    code, _, error = grid_map_command("convert a.npz b.npz --max-bytes 99")
    assert (code, "expected at most 99 bytes, got 1 layers of 100 bytes" in error) == (1, True)
    assert grid_map_command("convert a.npz b.npz --max-cells 25 --max-bytes 1e2")[0] == 0
    assert current_limits() == Limits()


def test_time_to_check_names_is_linear():
    names = [f"layer {number}" for number in range(200_000)]
    begin = time.perf_counter()
    assert select_layers(names, names[::-1]) == tuple(names[::-1])
    # Comparing each name with each other one takes minutes.
    assert time.perf_counter() - begin < 10
