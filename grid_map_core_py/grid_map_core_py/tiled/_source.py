# SPDX-License-Identifier: BSD-3-Clause
"""Where the layers of a tiled map come from, and windows of cells."""

from collections.abc import Iterator, Sequence
from typing import Protocol, TypeAlias

from .._arrays._checks import Layer, Size

Window: TypeAlias = tuple[slice, slice]
"""Rows and columns of a rectangle of cells, in map order; with a start and a stop, no step."""

TILE = 1024
"""Side of a tile, if neither the caller nor the source says it [cells]."""


class Source(Protocol):
    """Layers that are read window by window.

    It is sent to other processes and machines: it can be pickled, and opens files when it reads.
    """

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers in their order."""

    def describe(self) -> str:
        """Return a text that is the same in a later process if all windows are."""

    def prepare(self) -> None:
        """Compute what all windows need, before windows are read in several processes."""

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        """Return the named layers of a window: float32, (rows, cols), Fortran order, own memory.

        Args:
            window: a rectangle of cells on the map, not empty.
            names: layers that exist.

        Raises:
            GridMapError: the layers cannot be read or computed.
        """


class Tiles(Sequence[Window]):
    """The tiles of a map: windows of at most `side` rows and columns, row after row of tiles."""

    def __init__(self, size: Size, side: Size) -> None:
        """Cut `size` cells into tiles of `side` cells; the last ones may be smaller."""
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
        """Yield the tiles that have cells of a window."""
        firsts, lasts = (
            [(end - last) // part for end, part in zip(ends, self.side, strict=True)]
            for ends, last in (
                ([part.start for part in window], 0),
                ([part.stop for part in window], 1),
            )
        )
        for row in range(firsts[0], lasts[0] + 1):
            for column in range(firsts[1], lasts[1] + 1):
                yield self[row * self.counts[1] + column]


def widened(window: Window, cells: int, size: Size) -> Window:
    """Return a window with a border of some cells, as far as the map goes."""
    rows, columns = (
        slice(max(part.start - cells, 0), min(part.stop + cells, length))
        for part, length in zip(window, size, strict=True)
    )
    return rows, columns


def within(window: Window, outer: Window) -> Window:
    """Return a window counted from the first cell of one around it."""
    rows, columns = (
        slice(part.start - around.start, part.stop - around.start)
        for part, around in zip(window, outer, strict=True)
    )
    return rows, columns


def common(one: Window, other: Window) -> Window:
    """Return the cells that are in two windows; slices end before they start if there are none."""
    rows, columns = (
        slice(max(a.start, b.start), min(a.stop, b.stop)) for a, b in zip(one, other, strict=True)
    )
    return rows, columns


def shape(window: Window) -> Size:
    """Return the numbers of rows and columns of a window."""
    return window[0].stop - window[0].start, window[1].stop - window[1].start


def tile_name(window: Window) -> str:
    """Return the name of a window for messages."""
    return f"cells [{', '.join(f'{part.start}:{part.stop}' for part in window)}]"
