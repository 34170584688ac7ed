# SPDX-License-Identifier: BSD-3-Clause
"""Helpers for nodes that serve maps: file requests, submaps, tiled maps and a worker thread."""

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Size
from grid_map_core_py.errors import GridMapError, short
from grid_map_core_py.limits import check_cells
from grid_map_core_py.plugins import check
from grid_map_core_py.tiled import TiledMap, open_map

from .errors import RequestError
from .nodes import ConfiguredNode, read_parameter

T = TypeVar("T")


@contextmanager
def place_below(directory: str, path: str) -> Iterator[Path]:
    """Yield the path of a requested file; errors in the `with` block become `RequestError`.

    `path` is absolute or relative to `directory`. After symbolic links are resolved, the path must
    be inside `directory`. An empty `directory` rejects all requests.
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


def part(
    grid_map: GridMap | TiledMap,
    frame_id: str,
    position: Sequence[float],
    length: Sequence[float],
    layers: Sequence[str] | None = None,
) -> GridMap:
    """Return the submap of the cells that overlap a rectangle.

    Args:
        frame_id: expected frame of the map; empty accepts every frame.
        position: (2,) center of the rectangle [m].
        length: (2,) side lengths along x and y [m]; zeros select the whole map.
        layers: layers of a tiled map; None means all. A `GridMap` always keeps all layers.
    """
    if frame_id not in ("", grid_map.frame_id):
        raise RequestError(
            f"frame_id: expected {grid_map.frame_id!r}, that of the map, got {frame_id!r}"
        )
    if isinstance(grid_map, TiledMap):
        is_part = any(length)
        return grid_map.get_submap(position, length, layers) if is_part else grid_map.to_map(layers)
    return grid_map.get_submap(position, length) if any(length) else grid_map


def read_source(node: ConfiguredNode, note: str) -> Callable[[], TiledMap] | None:
    """Return a function that opens the map in the parameter `source`; None if it is empty.

    The parameters `frame_id` and `origin` are also read. `note` ends the description of `source`.
    """
    kind: Any = str | list[str]
    about = f"map of any size: a Zarr store, or one or more GeoTIFF files; {note}"
    source = read_parameter(node, "source", kind, "", description=about)
    about = "frame of the source; empty means the stored frame"
    frame_id = node.read("frame_id", "", about)
    about = (
        "latitude and longitude [deg, WGS 84] of the frame origin, for a georeferenced source; "
        "empty keeps the origin of the source"
    )
    origin = read_parameter(node, "origin", list[float], [], description=about)
    fits = len(origin) in (0, 2) and bool(np.isfinite(origin).all())
    check(fits, "origin", "a latitude and a longitude, or nothing", origin)
    return partial(open_source, source, frame_id, origin) if source else None


def open_source(
    source: str | list[str], frame_id: str = "", origin: Sequence[float] = ()
) -> TiledMap:
    """Open a tiled map without reading its layers."""
    tiled_map = open_map(source)
    if origin:
        tiled_map = tiled_map.with_origin(*origin)
    return replace(tiled_map, frame_id=frame_id) if frame_id else tiled_map


def window(tiled_map: TiledMap, position: ArrayLike, size: Size, layers: Sequence[str]) -> GridMap:
    """Return a window of `size` cells, centered as close to `position` (2,) [m] as possible.

    The window is aligned with the cells of the map. Cells outside the map are NaN.
    """
    check_cells("window", size, len(layers))
    first = tiled_map.geometry.cropped(*(slice(0, count) for count in size))
    shift = first.index_shift(position)
    stored, kept = [], []
    for start, count, cells in zip(shift, size, tiled_map.size, strict=True):
        stored.append(slice(max(start, 0), min(start + count, cells)))
        kept.append(slice(stored[-1].start - start, stored[-1].stop - start))
    grid_map = GridMap.from_geometry(first.shifted(shift), layers, frame_id=tiled_map.frame_id)
    grid_map.basic_layers = [name for name in tiled_map.basic_layers if name in layers]
    if all(part.start < part.stop for part in stored):
        block = tiled_map.get_block(stored[0], stored[1], layers)
        for name in layers:
            grid_map[name][kept[0], kept[1]] = block[name]
    return grid_map


class LatestOnly(Generic[T]):
    """Worker thread that calls a function with the newest item and drops older waiting items."""

    def __init__(self, function: Callable[[T], object]) -> None:
        self._function = function
        self._change = threading.Condition()
        self._waiting: T | None = None
        self._is_closed = False
        self._outcomes: deque[Exception | None] = deque(maxlen=100)
        # A daemon thread, so that a hanging disk cannot keep the process alive.
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def put(self, thing: T) -> None:
        """Queue an item, replacing any item that is still waiting."""
        with self._change:
            self._waiting = thing
            self._change.notify()

    def outcomes(self) -> Iterator[Exception | None]:
        """Yield the outcome of each newly finished call: an error, or None for success."""
        while self._outcomes:
            yield self._outcomes.popleft()

    def close(self, timeout: float) -> bool:
        """End the thread after the waiting item; return whether it ended within `timeout` [s]."""
        with self._change:
            self._is_closed = True
            self._change.notify()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._waiting is not None or self._is_closed)
                thing, self._waiting = self._waiting, None
            if thing is None:
                return
            try:
                self._function(thing)
            except Exception as error:  # reported by `outcomes`
                self._outcomes.append(error)
            else:
                self._outcomes.append(None)
