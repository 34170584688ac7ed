# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Damaged files as input for `fuzz.py`: bags of both storages, `.npz` files, YAML of images."""

import tempfile
from collections.abc import Callable, Iterable
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
    mcaps = [DATA / "cpp_tutorial_outputs.mcap"]
    for index, options in enumerate(({}, {"use_chunking": False}, {"enable_crcs": False})):
        mcaps.append(write_mcap(folder / f"{index}.mcap", [1, 2], **options))
    for compression in ("none", "lz4", "zstd"):
        save_to_bag(numbered_map(1), folder / compression, TOPIC, compression=compression)
        mcaps.append(folder / compression / f"{compression}_0.mcap")
    write_bag(folder / "database", [1, 2], "sqlite3")
    databases = folder / "database/database.db3", DATA / "cpp_move_sqlite/cpp_move_sqlite_0.db3"
    for compress in (False, True):
        save_npz(numbered_map(1), folder / f"{compress}.npz", compress=compress)
    values = np.arange(20.0).reshape(4, 5)
    images = save_images(GridMap((0.4, 0.5), 0.1, layers={"a": values}), folder / "images")
    values[0, 0] = np.nan
    pictures = folder / "pictures"
    save_images(GridMap((0.4, 0.5), 0.1, layers={"a": values}), pictures)
    readers: list[tuple[str, Iterable[Path], Path, Callable[[Path], Any]]] = [
        ("MCAP", mcaps, folder / "damaged", _maps),
        ("MCAP recovered", mcaps, folder / "damaged", _recovered),
        ("sqlite3", databases, folder / "damaged", _maps),
        ("metadata.yaml", [folder / "none/metadata.yaml"], folder / "none/metadata.yaml", _bag),
        ("npz", folder.glob("*.npz"), folder / "damaged", load_npz),
        ("map.yaml", [images], images, load_images),
        ("PNG", [pictures / "a.png"], pictures / "a.png", lambda _: load_images(pictures)),
    ]
    return [
        (name, tuple(file.read_bytes() for file in files), _through(target, read))
        for name, files, target, read in readers
    ]


def _maps(file: Path) -> tuple[GridMap, ...]:
    return tuple(bag_maps(file, TOPIC))


def _recovered(file: Path) -> tuple[GridMap, ...]:
    return tuple(bag_maps(file, TOPIC, recover=True))


def _bag(metadata: Path) -> tuple[GridMap, ...]:
    return _maps(metadata.parent)


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
