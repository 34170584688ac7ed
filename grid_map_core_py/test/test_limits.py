# SPDX-License-Identifier: BSD-3-Clause
"""Small inputs that claim much are refused before they take memory; limits can be raised."""

import struct
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from grid_map_core_py import (
    ConfigError,
    GridMap,
    LimitError,
    from_mesh,
    from_points,
    load,
)
from grid_map_core_py.conversions import rasterize_triangles
from grid_map_core_py.files import load_height_image, save_npz
from grid_map_core_py.limits import Limits, changed_limits, current_limits, set_limits

Bomb = Callable[[Path], Any]
CORNERS = [(0.0, 0.0, 0.0), (8000.0, 8000.0, 1.0)]
"""Points 11 km apart."""


def chunk(kind: bytes, content: bytes) -> bytes:
    checksum = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)


def png() -> bytes:
    """Return an image of 30,000 x 30,000 pixels, of which the first row has data."""
    head = struct.pack(">IIBBBBB", 30_000, 30_000, 8, 0, 0, 0, 0)
    data = zlib.compress(bytes(30_001))
    parts = chunk(b"IHDR", head), chunk(b"IDAT", data), chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def tiff(order: str) -> bytes:
    """Return the head of an image of 30,000 x 30,000 pixels."""
    mark = {"<": b"II", ">": b"MM"}[order]
    sides = [struct.pack(f"{order}HHII", tag, 4, 1, 30_000) for tag in (256, 257)]
    return mark + struct.pack(f"{order}HIH", 42, 8, 2) + b"".join(sides) + bytes(8)


def image(name: str, data: bytes) -> Bomb:
    def loaded(folder: Path) -> GridMap:
        (folder / name).write_bytes(data)
        return load(folder / name, resolution=1.0)

    return loaded


def nav2(folder: Path) -> Path:
    document = {"image": "map.png", "resolution": 0.1, "origin": [0.0, 0.0, 0.0]}
    document |= {"occupied_thresh": 0.65, "free_thresh": 0.2}
    (folder / "nav2.yaml").write_text(yaml.safe_dump(document))
    (folder / "map.png").write_bytes(png())
    return folder / "nav2.yaml"


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


def sparse_geotiff(folder: Path) -> Path:
    import rasterio

    profile = {"driver": "GTiff", "dtype": "float32", "tiled": True, "SPARSE_OK": True}
    profile |= {"width": 30_000, "height": 30_000, "count": 1}
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
    "PNG": (image("a.png", png()), SQUARE),
    "TIFF": (image("a.tif", tiff("<")), SQUARE),
    "TIFF >": (image("a.tif", tiff(">")), SQUARE),
    "BMP": (image("a.bmp", b"BM" + struct.pack("<12xIii", 40, 30_000, -30_000)), SQUARE),
    "PGM": (image("a.pgm", b"P5\n# comment\n30000 30000\n255\n"), SQUARE),
    "map_server": (lambda folder: load(nav2(folder)), SQUARE),
    "npz": (lambda folder: load(npz_without_layers(folder)), SQUARE),
    "GeoTIFF": (lambda folder: load(sparse_geotiff(folder)), SQUARE),
}


NEEDS = [pytest.mark.needs("rasterio")]


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=NEEDS * ("GeoTIFF" in kind)) for kind in BOMBS],
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


@pytest.mark.parametrize("ending", ["png", "pgm"])
def test_size_is_read_from_the_head_of_images(ending, tmp_path):
    path = tmp_path / f"a.{ending}"
    cv2.imwrite(str(path), np.zeros((20, 30, 1), np.uint8))
    with changed_limits(max_cells=600):
        assert load_height_image(path, resolution=1.0).size == (30, 20)
    with changed_limits(max_cells=599), pytest.raises(LimitError, match="got 20 x 30"):
        load_height_image(path, resolution=1.0)


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


def test_limits_are_raised_for_a_block_or_for_good():
    before = set_limits(max_ratio=3)
    try:
        assert before == Limits()
        with changed_limits(max_cells=80001**2, max_bytes=1e9):
            assert current_limits() == Limits(80001**2, 1e9, 3)
            with pytest.raises(LimitError, match="expected at most 1000000000 bytes"):
                from_points(CORNERS, 0.1)
            with changed_limits(max_bytes=5), ThreadPoolExecutor(1) as pool:
                assert pool.submit(current_limits).result() == Limits(80001**2, 5, 3)
        assert current_limits() == Limits(max_ratio=3)
    finally:
        set_limits(before)
    assert current_limits() == Limits()


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
