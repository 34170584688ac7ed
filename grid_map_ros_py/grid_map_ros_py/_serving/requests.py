# SPDX-License-Identifier: BSD-3-Clause
"""Requests to a server of maps: parts of a map, and files below a directory."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError, short
from grid_map_core_py.tiled import TiledMap

from ..errors import RequestError


def part(
    grid_map: GridMap | TiledMap,
    frame_id: str,
    position: Sequence[float],
    length: Sequence[float],
    layers: Sequence[str] | None = None,
) -> GridMap:
    """Return the cells of a map that overlap a rectangle.

    Args:
        grid_map: the map.
        frame_id: frame of the position; empty means the frame of the map.
        position: (2,) center of the rectangle [m].
        length: (2,) side lengths of the rectangle along x and y [m]; zeros select the whole map.
        layers: names of the layers to read from a tiled map; None reads all layers. Parts of other
            maps have all layers.
    """
    if frame_id not in ("", grid_map.frame_id):
        raise RequestError(
            f"frame_id: expected {grid_map.frame_id!r}, that of the map, got {frame_id!r}"
        )
    if isinstance(grid_map, TiledMap):
        is_part = any(length)
        return grid_map.get_submap(position, length, layers) if is_part else grid_map.to_map(layers)
    return grid_map.get_submap(position, length) if any(length) else grid_map


@contextmanager
def place_below(directory: str, path: str) -> Iterator[Path]:
    """Yield the path of a bag below a directory; errors of its use name the path of the request.

    Args:
        directory: the directory; an empty name refuses all paths.
        path: path from a request, absolute or relative to the directory. Links may not lead out of
            the directory.
    """
    if not directory:
        raise RequestError("files are refused: the parameter 'directory' is not set")
    if not path.isprintable():
        raise RequestError(f"file_path {short(path)}: expected no control characters")
    root = place = Path(directory).resolve()
    try:
        place = (root / path).resolve()
        if root not in place.parents:
            raise RequestError(f"expected a path below {str(root)!r}")
        yield place
    except (GridMapError, OSError, ValueError, RuntimeError) as error:
        text = error.strerror if isinstance(error, OSError) else error
        text = str(text).replace(f"{place}: ", "")
        raise RequestError(f"file_path {short(path)}: {text}") from error
