# SPDX-License-Identifier: BSD-3-Clause
"""Layer sources that are read window by window, and window functions."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np

from .._arrays._checks import Layer, Positions, Size
from ..map._geometry import GridGeometry

Window: TypeAlias = tuple[slice, slice]
"""Row and column slices (start, stop, no step) of a rectangle of cells in map order."""

Progress = Callable[[int, int], Any]
"""Function called after each tile with the number of finished tiles and the total number."""

_Data = TypeVar("_Data", bound="TiledData")

TILE = 1024
"""Default side of a tile [cells]."""


class Source(Protocol):
    """Provider of layers that are read window by window.

    Sources are pickled and sent to other processes and machines, so they open files only in `read`.
    The optional attribute `reads_layers_alone` is True if reading several layers together saves no
    time. Dask datasets then read only the layers that are used.
    """

    @property
    def layers(self) -> tuple[str, ...]:
        """Layer names, in order."""

    def describe(self) -> str:
        """Return text that identifies the data; a run is resumed only if the text is unchanged."""

    def prepare(self) -> None:
        """Prepare data that all windows share; called once before windows are read in parallel."""

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        """Return layers of a window as new (rows, cols) float32 arrays in Fortran order.

        Args:
            window: non-empty rectangle of cells within the map.
            names: names of existing layers.

        Raises:
            GridMapError: the layers cannot be read or computed.
        """


@dataclass(frozen=True, eq=False)
class TiledData:
    """Data of a tiled map; `TiledMap` adds the methods."""

    source: Source
    geometry: GridGeometry
    tile: Size
    frame_id: str = "map"
    timestamp: int = 0
    basic_layers: tuple[str, ...] = ()
    crs: str = ""
    origin: tuple[float, float] = (0.0, 0.0)

    @property
    def layers(self) -> tuple[str, ...]:
        """Layer names, in order."""
        return self.source.layers

    @property
    def size(self) -> Size:
        """Number of rows and columns."""
        return self.geometry.size

    @property
    def resolution(self) -> float:
        """Side of a cell [m]."""
        return self.geometry.resolution

    @property
    def position(self) -> Positions:
        """Center of the map, (2,) [m]."""
        return self.geometry.position

    @property
    def length(self) -> Positions:
        """Side lengths of the map along x and y, (2,) [m]."""
        return self.geometry.length

    def _in_frame_at(self: _Data, origin: Sequence[float]) -> _Data:
        """Return the map in a frame with its origin at (x, y) in the current frame [m]."""
        x, y = origin
        geometry = self.geometry.at(self.position - np.array([x, y]))
        return replace(self, geometry=geometry, origin=(self.origin[0] + x, self.origin[1] + y))

    @property
    def tiles(self) -> "Tiles":
        """Tiles of the map as windows of cells."""
        return Tiles(self.size, self.tile)


class Tiles(Sequence[Window]):
    """Tiles of a map, row by row; each tile is a window of at most `side` rows and columns."""

    def __init__(self, size: Size, side: Size) -> None:
        self.size, self.side = size, side
        self.counts = tuple(-(-length // part) for length, part in zip(size, side, strict=True))

    def __len__(self) -> int:
        return self.counts[0] * self.counts[1]

    def __getitem__(self, number: int) -> Window:  # type: ignore[override]
        if not 0 <= number < len(self):
            raise IndexError(number)
        places = divmod(number, self.counts[1])
        rows, columns = (
            slice(place * part, min((place + 1) * part, length))
            for place, part, length in zip(places, self.side, self.size, strict=True)
        )
        return rows, columns

    def touching(self, window: Window) -> Iterator[Window]:
        """Yield the tiles that overlap a window."""
        rows, columns = (
            range(part.start // side, (part.stop - 1) // side + 1)
            for part, side in zip(window, self.side, strict=True)
        )
        return (self[row * self.counts[1] + column] for row in rows for column in columns)


def widened(window: Window, cells: int, size: Size) -> Window:
    """Return a window widened by `cells` on all sides, clipped to a map of `size`."""
    rows, columns = (
        slice(max(part.start - cells, 0), min(part.stop + cells, length))
        for part, length in zip(window, size, strict=True)
    )
    return rows, columns


def within(window: Window, outer: Window) -> Window:
    """Return a window in coordinates of the enclosing window `outer`."""
    rows, columns = (
        slice(part.start - around.start, part.stop - around.start)
        for part, around in zip(window, outer, strict=True)
    )
    return rows, columns


def common(one: Window, other: Window) -> Window:
    """Return the intersection of two windows; if it is empty, a slice has stop <= start."""
    rows, columns = (
        slice(max(a.start, b.start), min(a.stop, b.stop)) for a, b in zip(one, other, strict=True)
    )
    return rows, columns


def shape(window: Window) -> Size:
    """Return the number of rows and columns of a window."""
    return window[0].stop - window[0].start, window[1].stop - window[1].start
