# SPDX-License-Identifier: BSD-3-Clause
"""Every writer of files: full disks, missing folders, endings of other formats."""

import os
from pathlib import Path

import numpy as np
import pytest

from grid_map_core_py import GridMap, GridMapError, load, save

OPTIONS = {
    "map.npz": {},
    "packed.npz": {"compress": True},
    "map.tif": {},
    "packed.tif": {"compress": True},
    "height.tif": {"bits": 32},
    "height.png": {},
    "occupancy.yaml": {"mode": "raw"},
    "scaled.yaml": {"mode": "scale"},
}
"""Files of all writers, with options of `save`."""

GDAL = pytest.mark.needs("rasterio")
WRITERS = [
    pytest.param(name, marks=GDAL if name in ("map.tif", "packed.tif") else ()) for name in OPTIONS
]


def noise(seed: int) -> GridMap:
    values = np.random.default_rng(seed).uniform(0, 100, (300, 250))
    return GridMap((30, 25), 0.1, layers={"elevation": values}, timestamp=seed)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize("limit", [0, 1000, 50_000])
@pytest.mark.parametrize("name", WRITERS)
def test_full_disk_keeps_the_old_file(tmp_path, capfd, full_disk, name, limit):
    path, options = tmp_path / name, OPTIONS[name]
    save(noise(1), path, **options)
    old = contents(tmp_path)
    with (
        full_disk(limit),
        pytest.raises(GridMapError, match=rf"{tmp_path}/\S+: cannot be written: File too large"),
    ):
        save(noise(2), path, **options)
    assert contents(tmp_path) == old
    assert capfd.readouterr() == ("", "")
    save(noise(2), path, **options)
    assert contents(tmp_path) != old


@pytest.mark.parametrize("name", WRITERS)
def test_missing_folder_is_named(tmp_path, name):
    folder = tmp_path / "none" / "of them"
    expected = rf"{folder}/{name.split('/')[0]}\S*: cannot be written: there is no folder {folder}$"
    with pytest.raises(GridMapError, match=expected):
        save(noise(1), folder / name, **OPTIONS[name])
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("name", WRITERS)
def test_folder_without_permission_is_named(tmp_path, name):
    folder = tmp_path / "theirs"
    folder.mkdir(mode=0o500)
    if os.access(folder, os.W_OK):  # as root
        folder = Path("/proc")
    with pytest.raises(GridMapError, match=rf"{folder}/\S+: cannot be written: ") as caught:
        save(noise(1), folder / name, **OPTIONS[name])
    assert ".partial" not in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "name", "expected"),
    [
        *(
            ("npz", f"x{ending}", r"a name that ends in \.npz")
            for ending in (".tif", ".png", ".PNG", ".yaml", ".mcap")
        ),
        *(
            ("geotiff", f"x{ending}", r"a name that ends in \.tif or \.tiff")
            for ending in (".npz", ".jpg", ".png")
        ),
        *(
            ("map_server", f"x{ending}", r"a name that ends in \.yaml or \.yml")
            for ending in (".png", ".pgm", ".npz")
        ),
        *(
            ("height_image", f"x{ending}", r"a name that ends in \.png or \.tif")
            for ending in (".jpg", ".npz", "")
        ),
    ],
)
def test_ending_of_another_kind_of_file_is_refused(tmp_path, kind, name, expected):
    with pytest.raises(GridMapError, match=f"{name}: expected {expected}"):
        save(noise(1), tmp_path / name, format=kind)
    assert not [*tmp_path.iterdir()]


@GDAL
@pytest.mark.parametrize("name", ["plain", "site.map", "site.v2"])
def test_names_without_known_ending_take_any_format(tmp_path, name):
    for kind in ("npz", "geotiff"):
        save(noise(1), tmp_path / name, format=kind)
        assert load(tmp_path / name, format=kind) == noise(1)
