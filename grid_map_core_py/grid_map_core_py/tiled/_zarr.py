# SPDX-License-Identifier: BSD-3-Clause
"""Zarr stores of layers: making them, opening them for writing, and their lock.

The stores are of Zarr format 2, which zarr-python 2 and 3 write. A chunk is a file with the bytes
of a layer's block in its memory order; zarr-python writes it under another name and renames it. A
chunk that is not there is NaN.
"""

import errno
import fcntl
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np

from .._arrays._checks import Size, is_name
from ..errors import GridMapError, LayerNotFoundError, MissingPackageError, required, short
from ..files._shared import storage_errors
from ..map._geometry import GridGeometry
from ._datasets import CRS_VARIABLE, DIMENSIONS
from ._xarray import attributes, coordinates, grid_mapping

_REMEDY = "pip install 'grid_map_core_py[tiled]'"

_METADATA = (".zgroup", "zarr.json")
"""Files that every store has, of format 2 and 3."""


@contextmanager
def store_errors(path: str | os.PathLike[str], doing: str) -> Iterator[None]:
    """Turn every error of reading or writing a store into one GridMapError that names it.

    Args:
        path: of the store, or of the part of it that is named.
        doing: "read" or "written".
    """
    try:
        yield
    except (LayerNotFoundError, MissingPackageError):
        raise
    except GridMapError as error:
        if os.fspath(path) not in str(error):
            error.args = (f"{path}: {error}",)
        raise
    except Exception as error:
        try:
            with storage_errors(Path(path), doing):
                raise
        except GridMapError as named:
            # A path has one slash less than the address.
            text = str(named).replace(str(Path(path)), os.fspath(path), 1)
            raise GridMapError(text) from error


def check_local(path: str | os.PathLike[str]) -> Path:
    """Return the path of a store to write, which is a folder of this machine."""
    name = os.fspath(path)
    if "://" in name or "::" in name:
        raise GridMapError(
            f"path: expected a folder of this machine, got {short(name)}. "
            "Write a local store and upload it"
        )
    return Path(name)


def check_names(names: Sequence[str]) -> None:
    """Refuse names of layers that a store cannot hold."""
    taken = (*DIMENSIONS, CRS_VARIABLE)
    for name in names:
        if not is_name(name) or name.startswith((".", "__")) or {*name} & {*"/\\"} or name in taken:
            raise GridMapError(
                "layers: expected names that a Zarr store can hold (without / and \\, not "
                f"beginning with . or __, none of {', '.join(taken)}), got {short(name)}"
            )


def create_group(
    path: Path,
    geometry: GridGeometry,
    names: Sequence[str],
    chunks: Size,
    *,
    frame_id: str,
    timestamp: int,
    basic_layers: Sequence[str],
    crs: str,
) -> Any:
    """Make a store without chunks in an empty or missing folder, and return its group."""
    zarr = required("zarr", f"{path}: a Zarr store", _REMEDY)
    check_names(names)
    form = {} if _is_zarr_2(zarr) else {"zarr_format": 2}
    group = zarr.open_group(str(path), mode="a", **form)
    # Readers make a coordinate of the variable, where rioxarray looks for it.
    about_crs = {"grid_mapping": CRS_VARIABLE, "coordinates": CRS_VARIABLE} if crs else {}
    for name in names:
        _create_layer(group, name, geometry.size, chunks, about_crs)
    for name, (_, values, about) in coordinates(geometry).items():
        # Values that equal the fill value are read as NaN.
        array = _create_array(group, name, values.shape, "<f8", values.shape, fill_value=np.nan)
        array[:] = values
        # `update` of zarr-python 3 writes the file once for each attribute.
        array.attrs.put(about | {"_ARRAY_DIMENSIONS": [name]})
    if crs:
        array = _create_array(group, CRS_VARIABLE, (), "<i4", ())
        array.attrs.put(grid_mapping(crs) | {"_ARRAY_DIMENSIONS": []})
    group.attrs.put(attributes(geometry, names, frame_id, timestamp, basic_layers))
    return group


def _is_zarr_2(zarr: Any) -> bool:
    return bool(zarr.__version__.startswith("2."))


def _create_layer(
    group: Any, name: str, shape: Sequence[int], chunks: Sequence[int], about: dict[str, Any]
) -> None:
    """Add a layer to a store: its chunks have the memory order of layers."""
    blosc = required("numcodecs", "a Zarr store", _REMEDY).Blosc
    packed = blosc("lz4", 1, blosc.SHUFFLE)
    options = {"fill_value": np.nan, "order": "F"}
    array = _create_array(group, name, shape, "<f4", chunks, compressor=packed, **options)
    array.attrs.put({"_ARRAY_DIMENSIONS": [*DIMENSIONS]} | about)


def _create_array(
    group: Any,
    name: str,
    shape: Sequence[int],
    dtype: str,
    chunks: Sequence[int],
    compressor: Any = None,
    **options: Any,
) -> Any:
    """Add an array to a store, by zarr-python 2 or 3."""
    options |= {"shape": tuple(shape), "chunks": tuple(chunks), "dtype": dtype}
    if hasattr(group, "create_array"):
        return group.create_array(name, compressors=compressor, **options)
    return group.create_dataset(name, compressor=compressor, **options)


def consolidate(path: Path) -> None:
    """Write the metadata of all layers of a store into one file, which is read at once."""
    zarr = required("zarr", f"{path}: a Zarr store", _REMEDY)
    zarr.consolidate_metadata(str(path))


def open_layer(store: str, name: str, *, empty_chunks: bool = False) -> Any:
    """Return an array of a store, to write into it.

    Args:
        store: path of the store.
        name: name of the layer.
        empty_chunks: write chunks without data, too; else they are left out.
    """
    zarr = required("zarr", f"{store}: a Zarr store", _REMEDY)
    if _is_zarr_2(zarr):
        return zarr.open_array(store, path=name, mode="r+", write_empty_chunks=empty_chunks)
    return zarr.open_array(store, path=name, mode="r+").with_config(
        {"write_empty_chunks": empty_chunks}
    )


def metadata_file(store: Path) -> Path:
    """Return the file that every store has, and that does not change while data is written.

    Raises:
        FileNotFoundError: there is no such folder.
        GridMapError: the folder is no store.
    """
    if not store.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(store))
    for name in _METADATA:
        if (store / name).is_file():
            return store / name
    raise GridMapError(f"{store}: expected a Zarr store, got a folder without {_METADATA[0]}")


def check_layers(store: Path) -> None:
    """Raise `GridMapError` for a layer whose description is lost: Zarr would leave it out."""
    for folder in store.iterdir():
        described = any((folder / name).is_file() for name in (".zarray", *_METADATA))
        if folder.is_dir() and not folder.name.startswith(".") and not described:
            raise GridMapError(f"{folder}: the file .zarray is missing")


@contextmanager
def locked(store: Path) -> Iterator[None]:
    """Let one process, and one thread of it, at a time write into a store; others wait.

    Raises:
        GridMapError: there is no store.
        OSError: it cannot be written to.
    """
    while True:
        file = metadata_file(store)
        with file.open("r+") as stream:
            fcntl.flock(stream, fcntl.LOCK_EX)
            # Another process may have replaced the store while this one waited.
            if is_same(stream, file):
                yield
                # Later runs see by the time that the content has changed.
                os.utime(file)
                return


def is_same(stream: IO[str], file: Path) -> bool:
    """Return whether an open file still has its name."""
    with suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(stream.fileno()), file.stat())
    return False
