# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Damaged files as input for `fuzz.py`: bags of both storages, `.npz` files, YAML of images."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from bags import DATA, TOPIC, numbered_map, write_bag, write_mcap

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import load_images, load_npz, save_images, save_npz
from grid_map_ros_py import bag_maps, save_to_bag

FOLDER = tempfile.TemporaryDirectory()
"""Folder of all files; removed when the process ends."""


def targets() -> list[tuple[str, tuple[bytes, ...], Callable[[bytes], Any]]]:
    """Return names, intact files as bytes, and functions that read such bytes as a file."""
    folder = Path(FOLDER.name)
    return [
        ("MCAP", _mcaps(folder), _through(folder / "damaged", _maps)),
        ("sqlite3", _databases(folder), _through(folder / "damaged", _maps)),
        ("metadata.yaml", _metadata(folder), _through(folder / "bag" / "metadata.yaml", _bag)),
        ("npz", _archives(folder), _through(folder / "damaged", load_npz)),
        ("map.yaml", *_images(folder / "images")),
        ("PNG", *_pictures(folder / "pictures")),
    ]


def _through(file: Path, read: Callable[[Path], Any]) -> Callable[[bytes], Any]:
    """Return a function that writes bytes to a file and reads it; its errors name the file."""

    def write_and_read(data: bytes) -> Any:
        file.write_bytes(data)
        try:
            return read(file)
        except GridMapError as error:
            if str(file.parent) not in str(error):
                raise AssertionError(f"no file is named in: {error}") from error
            raise

    return write_and_read


def _maps(file: Path) -> tuple[GridMap, ...]:
    return tuple(bag_maps(file, TOPIC))


def _bag(metadata: Path) -> tuple[GridMap, ...]:
    return _maps(metadata.parent)


def _mcaps(folder: Path) -> tuple[bytes, ...]:
    options: list[dict[str, Any]] = [{}, {"use_chunking": False}, {"enable_crcs": False}]
    files = [write_mcap(folder / "file.mcap", [1, 2], **chosen).read_bytes() for chosen in options]
    for compression in ("none", "lz4", "zstd"):
        save_to_bag(numbered_map(1), folder / "bag", TOPIC, compression=compression)
        files.append((folder / "bag" / "bag_0.mcap").read_bytes())
    return *files, (DATA / "cpp_tutorial_outputs.mcap").read_bytes()


def _databases(folder: Path) -> tuple[bytes, ...]:
    bag = write_bag(folder / "database", [1, 2], "sqlite3")
    recording = DATA / "cpp_move_sqlite" / "cpp_move_sqlite_0.db3"
    return (bag / "database.db3").read_bytes(), recording.read_bytes()


def _metadata(folder: Path) -> tuple[bytes, ...]:
    return ((folder / "bag" / "metadata.yaml").read_bytes(),)


def _archives(folder: Path) -> tuple[bytes, ...]:
    files = []
    for compress in (False, True):
        save_npz(numbered_map(1), folder / "map.npz", compress=compress)
        files.append((folder / "map.npz").read_bytes())
    return tuple(files)


def _images(folder: Path) -> tuple[tuple[bytes, ...], Callable[[bytes], Any]]:
    values = np.arange(20.0).reshape(4, 5)
    file = save_images(GridMap((0.4, 0.5), 0.1, layers={"a": values}), folder)
    return (file.read_bytes(),), _through(file, load_images)


def _pictures(folder: Path) -> tuple[tuple[bytes, ...], Callable[[bytes], Any]]:
    values = np.arange(20.0).reshape(4, 5)
    values[0, 0] = np.nan
    save_images(GridMap((0.4, 0.5), 0.1, layers={"a": values}), folder)
    file = folder / "a.png"
    data = file.read_bytes()
    return (data,), _through(file, lambda _: load_images(folder))
