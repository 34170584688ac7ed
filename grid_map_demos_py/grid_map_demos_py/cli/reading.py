# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps from files of any format, and what files tell about their maps without reading them."""

import json
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.errors import GridMapError, LayerNotFoundError
from grid_map_core_py.files import load_images, load_npz

from .errors import CommandError
from .formats import STANDARD, Format, format_of_source


class MapInfo(NamedTuple):
    """All of a map but its values; and the reference system of its frame where a file tells it."""

    geometry: GridGeometry
    frame_id: str
    timestamp: int
    start_index: tuple[int, int]
    layers: tuple[str, ...]
    basic_layers: tuple[str, ...]
    crs: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        crs = {"crs": self.crs} if self.crs else {}
        return crs | {
            "frame_id": self.frame_id,
            "timestamp": self.timestamp,
            "size": [*self.geometry.size],
            "resolution": self.geometry.resolution,
            "length": self.geometry.length.tolist(),
            "position": self.geometry.position.tolist(),
            "start_index": [*self.start_index],
            "layers": [*self.layers],
            "basic_layers": [*self.basic_layers],
        }


def checked_format(path: str, topic: str | None, index: int | None) -> Format:
    """Return the format of a file.

    Raises:
        CommandError: it is none that is known, or has not several maps to choose from.
    """
    found = format_of_source(path)
    if found is not Format.BAG and (topic is not None or index not in (None, 0, -1)):
        raise CommandError(f"{path}: is no bag, --topic and --index are for bags")
    return found


def read_map(
    path: str,
    topic: str | None = None,
    index: int | None = None,
    layers: Iterable[str] | None = None,
) -> GridMap:
    """Return a map of a file.

    Args:
        path: the file; `-` for standard input.
        topic, index: which map of a bag; None for the only topic, and for the last map.
        layers: names of the layers to read; None means all.

    Raises:
        CommandError, GridMapError: it cannot be read.
    """
    found = checked_format(path, topic, index)
    if found is Format.BAG:
        from grid_map_ros_py.bags import load_from_bag

        return load_from_bag(path, topic, layers, index=-1 if index is None else index)
    if found is Format.NPZ:
        with _npz_file(path) as file:
            return load_npz(file, layers)
    if found is Format.IMAGES:
        return with_layers_only(load_images(path), layers)
    if found is Format.GEOTIFF:
        from .geotiff import read_geotiff

        return read_geotiff(path, layers)
    raise CommandError(
        f"{path}: is no map; make one with 'grid-map convert {path} map.npz --resolution ...'"
    )


def with_layers_only(grid_map: GridMap, layers: Iterable[str] | None) -> GridMap:
    """Return a map without the layers that are not named, unless `layers` is None."""
    if layers is None:
        return grid_map
    wanted = [*layers]
    for name in wanted:
        if name not in grid_map:
            raise LayerNotFoundError(name, grid_map.layers)
    return grid_map.without_layers([name for name in grid_map if name not in wanted])


def map_info(path: str, topic: str | None = None, index: int | None = None) -> MapInfo:
    """Return what a file tells about one of its maps; args and errors are those of `read_map`."""
    found = checked_format(path, topic, index)
    if found is Format.BAG:
        from grid_map_ros_py.bags import BagReader

        from .bags import record_info

        with BagReader(path, topic) as bag:
            return record_info(bag[-1 if index is None else index])
    if found is Format.NPZ:
        with _npz_file(path) as file:
            return _npz_info(file)
    if found is Format.GEOTIFF:
        from .geotiff import geotiff_info

        return geotiff_info(path)
    return info_of(read_map(path, topic, index))


def info_of(grid_map: GridMap) -> MapInfo:
    """Return all of a map but its values."""
    return MapInfo(
        grid_map.geometry,
        grid_map.frame_id,
        grid_map.timestamp,
        grid_map.start_index,
        grid_map.layers,
        grid_map.basic_layers,
    )


@contextmanager
def standard_input() -> Iterator[Path]:
    """Yield a file with what comes from standard input; a pipe cannot be read here and there."""
    if sys.stdin is None or sys.stdin.isatty():
        raise CommandError("expected an .npz file on standard input, from a file or a pipe")
    with tempfile.NamedTemporaryFile(prefix="standard-input-", suffix=".npz") as file:
        shutil.copyfileobj(sys.stdin.buffer, file)
        file.flush()
        yield Path(file.name)


@contextmanager
def _npz_file(path: str) -> Iterator[Path]:
    if path != STANDARD:
        yield Path(path)
        return
    with standard_input() as file:
        try:
            yield file
        except LayerNotFoundError:
            raise
        except GridMapError as error:
            raise CommandError(str(error).replace(str(file), "standard input")) from error


def _npz_info(file: Path) -> MapInfo:
    grid_map = load_npz(file, layers=())
    # Now it is sure that the file is one of maps.
    with np.load(file) as archive:
        metadata = json.loads(str(archive["metadata"]))
    info = info_of(grid_map)
    names, basic = tuple(metadata["layers"]), tuple(metadata["basic_layers"])
    return info._replace(layers=names, basic_layers=basic)
