# SPDX-License-Identifier: BSD-3-Clause
"""Maps in NumPy's `.npz` files, exactly.

NumPy alone can read such a file: `np.load("map.npz")["layers/elevation"]` is a layer
in map order, and `metadata` is a text in JSON with everything else.
"""

import json
import math
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .._arrays._checks import Layer
from ..errors import GridMapError
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._atomic import new_file
from ._shared import StoredMap, check_ending, storage_errors

FORMAT = "grid_map"
VERSION = 1

_METADATA = "metadata"
_LAYERS = "layers/"

_LARGEST_METADATA = 2**24
"""Maximum size [bytes]."""

_LARGEST_RATIO = 1040
"""Deflate packs at most 1032 bytes into one."""


def save_npz(grid_map: GridMap, path: str | PathLike[str], *, compress: bool = False) -> None:
    """Write a map to an `.npz` file.

    Layers are stored in map order: a map that has moved comes back with start index (0, 0). The
    file is written atomically; an existing one is replaced.

    Args:
        grid_map: the map.
        path: the file; no ending is appended.
        compress: compress the file, which takes several times longer.

    Raises:
        GridMapError: the file cannot be written or cannot hold the name of a layer, or its name
            ends like another kind of file.
    """
    check_ending(path, ".npz")
    for name in grid_map:
        _check_name(name)
    arrays = {_LAYERS + name: grid_map.unwrapped(name) for name in grid_map}
    metadata = {
        "format": FORMAT,
        "version": VERSION,
        "size": grid_map.size,
        "resolution": grid_map.resolution,
        "position": grid_map.position.tolist(),
        "frame_id": grid_map.frame_id,
        "timestamp": grid_map.timestamp,
        "layers": grid_map.layers,
        "basic_layers": grid_map.basic_layers,
    }
    arrays[_METADATA] = np.array(json.dumps(metadata))
    compression = zipfile.ZIP_DEFLATED if compress else zipfile.ZIP_STORED
    # As `numpy.savez` does, of which old versions do not close the archive after an error.
    with (
        storage_errors(Path(path), "written"),
        new_file(path) as temporary,
        zipfile.ZipFile(temporary, "w", compression) as archive,
    ):
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def load_npz(path: str | PathLike[str], layers: Iterable[str] | None = None) -> GridMap:
    """Return the map in an `.npz` file that `save_npz` has written.

    Memory is allocated only after a check that the file has as many bytes as it declares.

    Args:
        path: the file.
        layers: names of the layers to read; None means all.

    Raises:
        GridMapError: the file is missing, damaged, or not of this format.
        LayerNotFoundError: it lacks a layer.
    """
    with _opened(path) as stored:
        return stored.load(layers)


def describe_npz(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the facts about the map of a file without reading a layer."""
    with _opened(path) as stored:
        return {"map": stored.facts()}


@contextmanager
def _opened(path: str | PathLike[str]) -> Iterator[StoredMap]:
    file = Path(path)
    with storage_errors(file, "read"), zipfile.ZipFile(file) as archive:
        packed = file.stat().st_size
        _check_sizes(archive, packed)
        found = _read_metadata(archive)
        rows, columns = found["size"]
        geometry = GridGeometry.from_size((rows, columns), found["resolution"], found["position"])

        def read(name: str) -> Layer:
            return _read_array(
                archive,
                _LAYERS + name,
                lambda dtype, shape: dtype == np.float32 and shape == geometry.size,
            )

        empty = GridMap.from_geometry(
            geometry, frame_id=found["frame_id"], timestamp=found["timestamp"]
        )
        yield StoredMap(
            empty, found["layers"], found["basic_layers"], partial(map, read), file, packed
        )


def _check_name(name: str) -> None:
    if len(name.encode()) >= 2**15:
        raise GridMapError(f"layer {name[:80]!r}: a file cannot hold this name")


def _check_sizes(archive: zipfile.ZipFile, available: int) -> None:
    """Refuse an archive whose members claim more than `available` bytes can hold."""
    for member in archive.infolist():
        largest = member.compress_size
        if member.compress_type != zipfile.ZIP_STORED:
            largest = _LARGEST_RATIO * largest + 1000
        if member.file_size > largest:
            raise ValueError(f"{member.filename!r} claims more bytes than it has")
        available -= member.compress_size
    if available < 0:
        raise ValueError("its members claim more bytes than it has")


def _read_metadata(archive: zipfile.ZipFile) -> dict[str, Any]:
    if f"{_METADATA}.npy" not in archive.namelist():
        raise ValueError("no file of a map: 'metadata' is missing")
    text = _read_array(archive, _METADATA, lambda dtype, shape: dtype.kind == "U" and shape == ())
    metadata = json.loads(str(text))
    if not isinstance(metadata, dict) or metadata.get("format") != FORMAT:
        raise ValueError("no file of a map: 'metadata' has another format")
    if metadata.get("version") != VERSION:
        raise ValueError(f"version {metadata.get('version')!r}, only {VERSION} is known")
    return metadata


def _read_array(archive: zipfile.ZipFile, name: str, is_expected: Any) -> npt.NDArray[Any]:
    """Return an array after checking the type and shape that its head announces."""
    info = archive.getinfo(f"{name}.npy")
    if name == _METADATA and info.file_size > _LARGEST_METADATA:
        raise ValueError(f"'metadata' has {info.file_size} bytes, which is absurd")
    with archive.open(info) as member:
        version = np.lib.format.read_magic(member)
        if version != (1, 0):
            raise ValueError(f"{name!r} is an array of another version: {version}")
        shape, _, dtype = np.lib.format.read_array_header_1_0(member)
        if not is_expected(dtype, shape):
            raise ValueError(f"{name!r} is an unexpected array: {dtype} {shape}")
        if info.file_size != member.tell() + math.prod(shape) * dtype.itemsize:
            raise ValueError(f"{name!r} has too few or too many bytes")
    with archive.open(info) as member:
        return np.lib.format.read_array(member, allow_pickle=False)
