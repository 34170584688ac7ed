# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Map server: holds a map, returns parts of it, and loads and saves it by request."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from grid_map_core_py import GridMap

from ..bags._bag import load_from_bag, save_to_bag
from ..errors import RequestError
from ..messages._grid_map import to_info, to_message

if TYPE_CHECKING:
    from grid_map_msgs.msg import GridMap as GridMapMessage
    from grid_map_msgs.msg import GridMapInfo


class MapServer:
    """A map to be requested as a whole or in part, and bags below a directory.

    Args:
        directory: bags are loaded and saved below it; None refuses both.
        storage: file format of saved bags, "mcap" or "sqlite3".
    """

    def __init__(self, directory: Path | None = None, storage: str = "mcap") -> None:
        self._directory = directory
        self._storage = storage
        self._map: GridMap | None = None

    @property
    def grid_map(self) -> GridMap:
        """The map.

        Raises:
            RequestError: there is no map yet.
        """
        if self._map is None:
            raise RequestError("there is no map yet")
        return self._map

    @grid_map.setter
    def grid_map(self, grid_map: GridMap) -> None:
        self._map = grid_map

    def part(
        self,
        frame_id: str,
        position: tuple[float, float],
        length: tuple[float, float],
        layers: Sequence[str] = (),
    ) -> "GridMapMessage":
        """Return the cells of the map that a rectangle overlaps.

        Args:
            frame_id: frame of the position; empty means the frame of the map.
            position: center of the rectangle [m].
            length: side lengths of the rectangle along x and y [m]; zeros mean the whole map.
            layers: names of the layers; an empty sequence means all.

        Raises:
            RequestError: there is no map, or it has another frame.
            OutOfMapError: the rectangle does not overlap the map.
            GeometryError: a length is negative, or a number is not finite.
            LayerNotFoundError: the map lacks a layer.
        """
        grid_map = self.grid_map
        if frame_id not in ("", grid_map.frame_id):
            raise RequestError(
                f"frame_id: expected {grid_map.frame_id!r}, that of the map, got {frame_id!r}"
            )
        if any(length):
            grid_map = grid_map.get_submap(position, length)
        return to_message(grid_map, layers or None)

    def info(self) -> "GridMapInfo":
        """Return size, resolution and place of the map.

        Raises:
            RequestError: there is no map.
        """
        return to_info(self.grid_map.geometry)

    def load(self, path: str, topic: str = "") -> GridMap:
        """Return the last map of a bag.

        Args:
            path: path of the bag below the directory, absolute or relative to it.
            topic: topic in the bag; empty means the only topic with maps.

        Raises:
            RequestError: the path is not below the directory, or there is no directory.
            BagError: the bag cannot be read.
        """
        return load_from_bag(path_inside(self._directory, path), topic or None, unwrap=False)

    def save(self, path: str, topic: str) -> None:
        """Write the map to a bag, which replaces an existing one.

        Args:
            path: as for `load`.
            topic: topic in the bag.

        Raises:
            RequestError: the path is not below the directory, or there is no directory or no map.
            BagError: the bag cannot be written.
        """
        grid_map, target = self.grid_map, path_inside(self._directory, path)
        save_to_bag(grid_map, target, topic, storage=self._storage)


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
