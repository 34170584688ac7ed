# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Requests to a server of maps: parts of a map, and files below a directory."""

from collections.abc import Sequence
from pathlib import Path

from grid_map_core_py import GridMap

from ..errors import RequestError


def part(
    grid_map: GridMap, frame_id: str, position: Sequence[float], length: Sequence[float]
) -> GridMap:
    """Return the cells of a map that a rectangle overlaps.

    Args:
        grid_map: the map.
        frame_id: frame of the position; empty means the frame of the map.
        position: (2,) center of the rectangle [m].
        length: (2,) side lengths of the rectangle along x and y [m]; zeros mean the whole map.

    Raises:
        RequestError: the map has another frame.
        OutOfMapError: the rectangle does not overlap the map.
        GeometryError: a length is negative, or a number is not finite.
    """
    if frame_id not in ("", grid_map.frame_id):
        raise RequestError(
            f"frame_id: expected {grid_map.frame_id!r}, that of the map, got {frame_id!r}"
        )
    return grid_map.get_submap(position, length) if any(length) else grid_map


def path_inside(directory: Path | None, path: str) -> Path:
    """Return the resolved path if it and the files in it are below a directory.

    Args:
        directory: the directory; None refuses every path.
        path: absolute, or relative to the directory. Symbolic links and `..` are followed first.

    Raises:
        RequestError: the path is not below the directory, or is no valid path.
    """
    if directory is None:
        raise RequestError("files are refused: the parameter 'directory' is not set")
    root = directory.resolve()
    try:
        target = (root / path).resolve()
        # The files of a bag may also be symbolic links.
        found = [target, *(file.resolve() for file in target.iterdir())] if target.is_dir() else []
    except (OSError, RuntimeError, ValueError) as error:
        raise RequestError(f"file_path {path!r}: {error}") from error
    if not all(root in place.parents for place in found or [target]):
        raise RequestError(f"file_path: expected a path below {str(root)!r}, got {path!r}")
    return target
