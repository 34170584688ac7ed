# SPDX-License-Identifier: BSD-3-Clause
"""Files of a Zarr store: creating them, opening them for writing, and the lock of a store.

Stores have Zarr format 2, which zarr-python 2 and 3 write. A chunk is a file that holds a block of
a layer in the memory order of layers; zarr-python writes it under another name and renames it.
Cells of missing chunks are NaN.
"""

import errno
import fcntl
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays._checks import Size, is_name
from ..errors import GridMapError, required, short
from ._datasets import CRS_VARIABLE, DIMENSIONS, attributes, coordinates, grid_mapping
from ._engine import REMEDY
from ._source import TiledData


def is_local(name: str) -> bool:
    """Return whether a store is a folder, and not at an address of fsspec."""
    return "://" not in name and "::" not in name


def check_local(path: str | os.PathLike[str]) -> Path:
    """Return the path of a store to write, which is a folder of this machine."""
    name = os.fspath(path)
    if not is_local(name):
        raise GridMapError(
            f"path: expected a folder of this machine, got {short(name)}. "
            "Write a local store and upload it"
        )
    return Path(name)


def create_layers(path: Path, tiled_map: TiledData, names: Sequence[str]) -> None:
    """Make a store without chunks in an empty folder, for some layers of a map."""
    zarr = required("zarr", f"{path}: a Zarr store", REMEDY)
    blosc = required("numcodecs", "a Zarr store", REMEDY).Blosc
    taken = (*DIMENSIONS, CRS_VARIABLE)
    for name in names:
        if not is_name(name) or name.startswith((".", "__")) or {*name} & {*"/\\"} or name in taken:
            raise GridMapError(
                "layers: expected names that a Zarr store can hold (without / and \\, not "
                f"beginning with . or __, none of {', '.join(taken)}), got {short(name)}"
            )
    geometry, crs = tiled_map.geometry, tiled_map.crs
    form = {} if _is_zarr_2(zarr) else {"zarr_format": 2}
    group = zarr.open_group(str(path), mode="a", **form)

    def create(
        name: str,
        dtype: str,
        shape: Size | tuple[int, ...],
        chunks: Size | tuple[int, ...],
        dimensions: Sequence[str],
        about: dict[str, Any],
        **options: Any,
    ) -> Any:
        options |= {"shape": shape, "chunks": chunks, "dtype": dtype}
        if hasattr(group, "create_array"):
            options["compressors"] = options.pop("compressor", None)
            array = group.create_array(name, **options)
        else:
            array = group.create_dataset(name, **{"compressor": None} | options)
        # `update` of zarr-python 3 writes the file once for each attribute.
        array.attrs.put(about | {"_ARRAY_DIMENSIONS": [*dimensions]})
        return array

    # Readers make a coordinate of the variable, where rioxarray looks for it.
    about_crs = {"grid_mapping": CRS_VARIABLE, "coordinates": CRS_VARIABLE} if crs else {}
    packing = {"compressor": blosc("lz4", 1, blosc.SHUFFLE), "fill_value": np.nan, "order": "F"}
    for name in names:
        create(name, "<f4", geometry.size, tuple(tiled_map.tile), DIMENSIONS, about_crs, **packing)
    for name, (_, values, about) in coordinates(geometry, tiled_map.origin).items():
        # Values that equal the fill value are read as NaN.
        array = create(name, "<f8", values.shape, values.shape, [name], about, fill_value=np.nan)
        array[:] = values
    if crs:
        create(CRS_VARIABLE, "<i4", (), (), [], grid_mapping(crs))
    about = tiled_map.frame_id, tiled_map.timestamp, tiled_map.basic_layers, tiled_map.origin
    group.attrs.put(attributes(geometry, names, *about))
    # One file with the metadata of all layers is read at once.
    zarr.consolidate_metadata(str(path))


def _is_zarr_2(zarr: Any) -> bool:
    return bool(zarr.__version__.startswith("2."))


def open_layer(store: str, name: str, *, empty_chunks: bool = False) -> Any:
    """Return the array of a layer, to write into it.

    Args:
        store: path of the store.
        name: name of the layer.
        empty_chunks: write chunks without finite cells, too.
    """
    zarr = required("zarr", f"{store}: a Zarr store", REMEDY)
    options = {"write_empty_chunks": empty_chunks}
    if _is_zarr_2(zarr):
        return zarr.open_array(store, path=name, mode="r+", **options)
    return zarr.open_array(store, path=name, mode="r+").with_config(options)


def metadata_file(store: Path) -> Path:
    """Return the file that every store has, and that does not change while data is written.

    Raises:
        FileNotFoundError: there is no such folder.
        GridMapError: the folder is no store.
    """
    if not store.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(store))
    # Of formats 2 and 3.
    for name in (".zgroup", "zarr.json"):
        if (store / name).is_file():
            return store / name
    raise GridMapError(f"{store}: expected a Zarr store, got a folder without .zgroup")


@contextmanager
def locked(store: Path) -> Iterator[None]:
    """Let one thread of one process at a time write into a store; others wait.

    Raises:
        GridMapError: there is no store.
        OSError: the store cannot be written to.
    """
    with metadata_file(store).open("r+") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        yield
        # Later runs see from the time that the content has changed.
        os.utime(store)
