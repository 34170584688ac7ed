# SPDX-License-Identifier: BSD-3-Clause
"""Requests to a server of maps: parts of a map, and files below a directory."""

import math
import os
import shutil
import stat
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError, short
from grid_map_core_py.limits import check_bytes
from grid_map_core_py.tiled import TiledMap

from ..errors import RequestError

_DESCRIPTORS = Path("/proc/self/fd")


def part(
    grid_map: GridMap | TiledMap,
    frame_id: str,
    position: Sequence[float],
    length: Sequence[float],
    layers: Sequence[str] | None = None,
) -> GridMap:
    """Return the cells of a map that a rectangle overlaps.

    Args:
        grid_map: the map.
        frame_id: frame of the position; empty means the frame of the map.
        position: (2,) center of the rectangle [m].
        length: (2,) side lengths of the rectangle along x and y [m]; zeros mean the whole map.
        layers: names of the layers to read of a tiled map, None for all; others have all layers.

    Raises:
        RequestError: the map has another frame.
        OutOfMapError: the rectangle does not overlap the map.
        GeometryError: a length is negative, or a number is not finite.
        LimitError: the part of a tiled map has more cells than the limits allow.
        GridMapError: a tiled map cannot be read.
    """
    if frame_id not in ("", grid_map.frame_id):
        raise RequestError(
            f"frame_id: expected {grid_map.frame_id!r}, that of the map, got {frame_id!r}"
        )
    if isinstance(grid_map, TiledMap):
        is_part = any(length)
        return grid_map.submap(position, length, layers) if is_part else grid_map.to_map(layers)
    return grid_map.get_submap(position, length) if any(length) else grid_map


@contextmanager
def place_to_write(directory: Path | None, path: str) -> Iterator[Path]:
    """Yield the path of a bag to write below a directory.

    The path begins with the descriptor of an open folder, so that links that are exchanged
    meanwhile divert nothing.

    Args:
        directory: the directory; None refuses every path.
        path: absolute, or relative to the directory; no part of it may be a link.

    Raises:
        RequestError: the path is not below the directory, or the bag cannot be written.
    """
    with ExitStack() as stack:
        folder, name = _folder_of(stack, directory, path)
        place = _DESCRIPTORS / str(folder) / name
        stack.enter_context(_errors_of(path, place))
        if place.is_symlink():
            raise RequestError("expected no symbolic link")
        yield place


@contextmanager
def place_to_read(directory: Path | None, path: str) -> Iterator[Path]:
    """Yield the path of a bag to read below a directory.

    It is in a private folder, with a link to the descriptor of each file of the bag. Arguments and
    errors are those of `place_to_write`.
    """
    with ExitStack() as stack, TemporaryDirectory() as private:
        folder, name = _folder_of(stack, directory, path)
        place = Path(private) / name
        stack.enter_context(_errors_of(path, place))
        bag = _opened(stack, name, folder)
        if stat.S_ISDIR(os.fstat(bag).st_mode):
            place.mkdir()
            for file in (_DESCRIPTORS / str(bag)).iterdir():
                _lend(_opened(stack, file.name, bag), place / file.name)
        else:
            _lend(bag, place)
        yield place


def _folder_of(stack: ExitStack, directory: Path | None, path: str) -> tuple[int, str]:
    """Return the descriptor of the folder that holds a file, and the name of the file in it."""
    if directory is None:
        raise RequestError("files are refused: the parameter 'directory' is not set")
    if not path.isprintable():
        raise RequestError(f"file_path {short(path)}: expected no control characters")
    root, given = directory.resolve(), Path(path)
    for base in (root, directory.absolute()):
        given = given.relative_to(base) if given.is_relative_to(base) else given
    if given.is_absolute() or ".." in given.parts or not given.parts:
        raise RequestError(f"file_path: expected a path below {str(root)!r}, got {short(path)}")
    with _errors_of(path, root):
        folder = _opened(stack, root, None)
        for name in given.parts[:-1]:
            folder = _opened(stack, name, folder)
    return folder, given.name


@contextmanager
def _errors_of(path: str, place: Path) -> Iterator[None]:
    """Let errors name the path of the request."""
    try:
        yield
    except (GridMapError, OSError, ValueError) as error:
        text = error.strerror if isinstance(error, OSError) else error
        text = str(text).replace(f"{place}: ", "")
        raise RequestError(f"file_path {short(path)}: {text}") from error


def _opened(stack: ExitStack, path: str | Path, folder: int | None) -> int:
    """Return the descriptor of a file or folder in a folder; a link is an error."""
    # A pipe would wait for a writer.
    number = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
    stack.callback(os.close, number)
    return number


def _lend(number: int, place: Path) -> None:
    """Let `place` be the open file; a copy for sqlite3, which would look where the link leads."""
    source = _DESCRIPTORS / str(number)
    if not source.is_file():
        return
    if ".db3" in place.name:
        check_bytes(place.name, source.stat().st_size, math.inf)
        shutil.copyfile(source, place)
    else:
        place.symlink_to(source)
