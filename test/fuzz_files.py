# SPDX-License-Identifier: BSD-3-Clause
"""Input for `fuzz.py`: files of maps, images and bags."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from bags import DATA, TOPIC, numbered_map, write_bag, write_mcap

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import (
    load_geotiff,
    load_height_image,
    load_map_server,
    load_npz,
    save_geotiff,
    save_height_image,
    save_map_server,
    save_npz,
)
from grid_map_ros_py import bag_maps, save_to_bag


def targets(folder: Path) -> list[tuple[str, Sequence[bytes], Callable[[bytes], Any]]]:
    """Return names, intact files as bytes, and functions that read such bytes as a file.

    Args:
        folder: folder of all files.
    """
    _write(folder)
    readers: list[tuple[str, str, str, Callable[[Path], Any]]] = [
        ("MCAP", "*/*.mcap", "damaged", _maps),
        ("MCAP recovered", "*/*.mcap", "damaged", partial(_maps, recover=True)),
        ("sqlite3", "*/*.db3", "damaged", _maps),
        ("metadata.yaml", "none/*.yaml", "none/metadata.yaml", lambda file: _maps(file.parent)),
        ("npz", "*.npz", "damaged", load_npz),
        ("nav2 map.yaml", "nav2.yaml", "nav2.yaml", load_map_server),
        ("PGM", "nav2.pgm", "nav2.pgm", lambda file: load_map_server(file.with_suffix(".yaml"))),
        ("height image", "height.*", "damaged", partial(load_height_image, resolution=0.1)),
        ("GeoTIFF", "*.tif", "damaged.tif", load_geotiff),
    ]
    return [
        (
            name,
            [file.read_bytes() for file in sorted(folder.glob(pattern))],
            _reader(folder / damaged, read),
        )
        for name, pattern, damaged, read in readers
    ]


def _write(folder: Path) -> None:
    """Write intact files of all formats."""
    for index, options in enumerate(({}, {"use_chunking": False}, {"enable_crcs": False})):
        (folder / str(index)).mkdir()
        write_mcap(folder / f"{index}/{index}.mcap", [1, 2], **options)
    for compression in ("none", "lz4", "zstd"):
        save_to_bag(numbered_map(1), folder / compression, TOPIC, compression=compression)
    write_bag(folder / "database", [1, 2], "sqlite3")
    for bag in ("cpp_tutorial_outputs.mcap", "cpp_move_sqlite/cpp_move_sqlite_0.db3"):
        path = folder / "cpp" / Path(bag).name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes((DATA / bag).read_bytes())
    for compress in (False, True):
        save_npz(numbered_map(1), folder / f"{compress}.npz", compress=compress)
        save_geotiff(numbered_map(1), folder / f"{compress}.tif", compress=compress)
    values = np.linspace(0, 1, 20, dtype=np.float32).reshape(4, 5)
    grid_map = GridMap((0.4, 0.5), 0.1, layers={"elevation": values})
    save_map_server(grid_map, folder / "nav2.yaml", data_min=0.0, data_max=1.0)
    save_height_image(grid_map, folder / "height.tiff")
    for ending in ("bmp", "pgm"):
        cv2.imwrite(str(folder / f"height.{ending}"), (255 * values).astype(np.uint8))
    values[0, 0] = np.nan
    grid_map["elevation"] = values
    save_height_image(grid_map, folder / "height.png")


def _maps(file: Path, *, recover: bool = False) -> tuple[GridMap, ...]:
    return tuple(bag_maps(file, TOPIC, recover=recover))


def _reader(file: Path, read: Callable[[Path], Any]) -> Callable[[bytes], Any]:
    """Return a function that writes bytes to a file, reads it, and restores it.

    Its errors name a file in the same folder, or begin with the path of another one.
    """
    intact = file.read_bytes() if file.exists() else b""

    def write_and_read(data: bytes) -> Any:
        file.write_bytes(data)
        try:
            return read(file)
        except GridMapError as error:
            if str(file.parent) not in str(error) and not str(error).startswith("/"):
                raise AssertionError(f"no file is named in: {error}") from error
            raise
        finally:
            file.write_bytes(intact)

    return write_and_read
