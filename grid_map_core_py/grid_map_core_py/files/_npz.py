# SPDX-License-Identifier: BSD-3-Clause
"""Stores complete maps in `.npz` files.

NumPy can read these files: `np.load("map.npz")["layers/elevation"]` is a layer in map order. The
entry `metadata` is a JSON string with all other attributes.
"""

import json
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays._checks import Layer, as_crs
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._shared import StoredMap, check_ending, new_file, storage_errors

FORMAT = "grid_map"
VERSION = 1

_METADATA = "metadata"
_LAYERS = "layers/"


def save_npz(grid_map: GridMap, path: str | PathLike[str], *, compress: bool = False) -> None:
    """Write a map to an `.npz` file.

    Layers are stored in map order, so the loaded map has the start index (0, 0). The file is
    written atomically. An existing file is replaced.

    Args:
        grid_map: the map.
        path: path of the file; `.npz` is not appended.
        compress: if True, compress the file; saving then takes several times as long.
    """
    check_ending(path, ".npz")
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
        "crs": grid_map.crs,
        "origin": grid_map.origin,
    }
    arrays[_METADATA] = np.array(json.dumps(metadata))
    compression = zipfile.ZIP_DEFLATED if compress else zipfile.ZIP_STORED
    # In NumPy 1.26, `numpy.savez` does not close the archive after an error.
    with (
        storage_errors(Path(path), "written"),
        new_file(path) as temporary,
        zipfile.ZipFile(temporary, "w", compression) as archive,
    ):
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def load_npz(path: str | PathLike[str], layers: Iterable[str] | None = None) -> GridMap:
    """Load a map from an `.npz` file written by `save_npz`.

    Args:
        path: the file.
        layers: names of the layers to read; None means all.
    """
    with _opened(path) as stored:
        return stored.load(layers)


def describe_npz(path: str | PathLike[str]) -> dict[str, Any]:
    with _opened(path) as stored:
        return {"map": stored.facts()}


@contextmanager
def _opened(path: str | PathLike[str]) -> Iterator[StoredMap]:
    file = Path(path)
    with storage_errors(file, "read"), zipfile.ZipFile(file) as archive:

        def read(name: str) -> Layer:
            with archive.open(f"{name}.npy") as member:
                return np.lib.format.read_array(member, allow_pickle=False)

        if f"{_METADATA}.npy" not in archive.namelist():
            raise ValueError("no file of a map: 'metadata' is missing")
        found = json.loads(str(read(_METADATA)))
        if found["format"] != FORMAT or found["version"] != VERSION:
            expected = f"format {FORMAT!r} of version {VERSION}"
            raise ValueError(f"expected {expected}, got {found['format']!r} {found['version']!r}")
        rows, columns = found["size"]
        geometry = GridGeometry.from_size((rows, columns), found["resolution"], found["position"])
        empty = GridMap.from_geometry(
            geometry, frame_id=found["frame_id"], timestamp=found["timestamp"]
        )
        east, north = map(float, found.get("origin", (0.0, 0.0)))
        empty._reference = as_crs(found.get("crs")), (east, north)
        yield StoredMap(
            empty,
            found["layers"],
            found["basic_layers"],
            lambda names: (read(_LAYERS + name) for name in names),
            file,
        )
