# SPDX-License-Identifier: BSD-3-Clause
"""Geometry of a grid: conversion between positions and cell indices.

Cells are counted from the corner with the largest x and y, rows towards -x and columns towards -y,
whatever the start index is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import (
    Cells,
    Mask,
    Pair,
    Positions,
    Size,
    as_cells,
    as_finite,
    as_number,
    as_pair,
    as_positions,
    as_size,
)
from .._arrays._pieces import PIECE, slices
from ..errors import GeometryError, OutOfMapError
from . import _ring_buffer as ring_buffer
from ._axis import Axis, both_axes

_SUBNORMAL = float(np.nextafter(np.finfo(np.float64).tiny, 0.0))
"""Largest subnormal number; a resolution [m] must be larger, as subnormals are imprecise."""

_LARGEST_SIDE = 2**31  # largest number of cells along a side; larger layers cannot be addressed
_LARGEST_SHIFT = 2.0**52  # largest shift [cells]; float64 is too imprecise for larger shifts


@dataclass(frozen=True, init=False, eq=False, repr=False)
class GridGeometry:
    """Immutable geometry of a grid: size, resolution and position.

    Args:
        length: (2,) side lengths along x and y [m]; rounded to whole cells.
        resolution: side of a cell [m].
        position: (2,) center of the map [m], map frame.

    Raises:
        GeometryError: a length or the resolution is not positive and finite, `position` is not
            finite, or a side would have no cell or more than 2**31 cells.
    """

    _x: Axis
    _y: Axis
    size: Size
    resolution: float

    def __init__(
        self, length: ArrayLike, resolution: float, position: ArrayLike = (0.0, 0.0)
    ) -> None:
        x, y = sides = as_pair(length, "length")
        resolution = as_finite(resolution, "resolution", "a positive number", above=_SUBNORMAL)
        if not min(sides) > 0:
            raise GeometryError(f"length: expected positive numbers, got {sides}")
        # The quotient is positive: adding 0.5 and truncating rounds half away from zero.
        rows, columns = x / resolution + 0.5, y / resolution + 0.5
        if not min(rows, columns) >= 1:
            raise GeometryError(
                f"length: expected at least half a cell of {resolution} m, got {sides}"
            )
        if not max(rows, columns) < _LARGEST_SIDE + 1:
            raise GeometryError(
                f"length: expected at most 2**31 cells of {resolution} m, got {sides}"
            )
        center_x, center_y = as_pair(position, "position")
        self._set_up(
            Axis(int(rows), resolution, center_x), Axis(int(columns), resolution, center_y)
        )

    @classmethod
    def from_size(
        cls, size: Size, resolution: float, position: ArrayLike = (0.0, 0.0)
    ) -> GridGeometry:
        """Create a geometry from `size`, the number of rows and columns."""
        (rows, columns), resolution = as_size(size, "size"), as_number(resolution, "resolution")
        return cls((rows * resolution, columns * resolution), resolution, position)

    def at(self, position: ArrayLike) -> GridGeometry:
        """Return a grid of the same size and resolution, centered at `position` (2,) [m]."""
        x, y = as_pair(position, "position")
        return self._of(self._x.at(x), self._y.at(y))

    @cached_property
    def length(self) -> Positions:
        """(2,) side lengths along x and y [m]; read-only."""
        return _read_only(self._sides)

    @cached_property
    def position(self) -> Positions:
        """(2,) center of the map [m]; read-only."""
        return _read_only(self._middle)

    @property
    def place(self) -> str:
        """Center and length as text, for error messages."""
        return f"center {self._middle}, length {self._sides}"

    @property
    def corner(self) -> Positions:
        """(2,) corner of the map with the largest x and y [m], at cell (0, 0)."""
        return self.position + 0.5 * self.length

    def is_inside(self, positions: ArrayLike) -> Mask:
        """Return a mask of the positions inside the map.

        The +x and +y borders belong to the map; the -x and -y borders do not.

        Args:
            positions: (..., 2) x, y [m], map frame; NaN is outside.

        Returns:
            (...) bool.
        """
        positions = as_positions(positions)
        points = positions.reshape(-1, 2)
        inside = np.empty(len(points), dtype=np.bool_)
        with np.errstate(over="ignore"):
            for begin in range(0, len(points), PIECE):
                part = slice(begin, begin + PIECE)
                x, y = points[part].T
                np.logical_and(self._x.contains(x), self._y.contains(y), out=inside[part])
        return inside.reshape(positions.shape[:-1])

    def contains(self, position: Pair) -> bool:
        """Return whether one position x, y [m] is on the map; `is_inside` accepts several."""
        x, y = position
        return bool(self._x.contains(x) and self._y.contains(y))

    def cell_at(self, position: Pair, start_index: Size = (0, 0)) -> Size | None:
        """Return the cell that contains one position x, y [m], or None outside the map."""
        if not self.contains(position):
            return None
        x, y = position
        rows, columns = self.size
        row, column = start_index
        return (self._x.cell_at(x) + row) % rows, (self._y.cell_at(y) + column) % columns

    def cells_at(self, positions: ArrayLike, start_index: Size = (0, 0)) -> tuple[Cells, Mask]:
        """Return the cell that contains each position, and a mask of the positions on the map.

        Args:
            positions: (..., 2) x, y [m], map frame.
            start_index: buffer index of cell (0, 0); if (0, 0), the result is in map order.

        Returns:
            cells: rows and columns, two arrays (...) int64. A position outside the map gets the
                border cell that is nearest along each axis.
            inside: (...) bool, True for positions on the map.
        """
        positions = as_positions(positions)
        points = positions.reshape(-1, 2)
        cells = np.empty((2, len(points)), dtype=np.int64)
        inside = np.ones(len(points), dtype=np.bool_)
        with np.errstate(over="ignore"):
            for begin in range(0, len(points), PIECE):
                part = slice(begin, begin + PIECE)
                for number, axis in enumerate((self._x, self._y)):
                    coordinates, size = points[part, number], axis.size
                    steps = axis.steps(coordinates)
                    # Usually all are inside, and this check is faster than clamping.
                    if not (steps.min() > self._rounding and steps.max() < size - self._rounding):
                        inside[part] &= axis.contains(coordinates)
                        # NaN becomes cell 0. Just inside the far border, steps may round to `size`.
                        np.fmax(steps, 0.0, out=steps)
                        np.minimum(steps, size - 1, out=steps)
                    found = cells[number, part]
                    found[...] = steps
                    if start_index[number]:
                        ring_buffer.place(found, start_index[number], size)
        rows, columns = cells.reshape(2, *positions.shape[:-1])
        return (rows, columns), inside.reshape(positions.shape[:-1])

    def center_of(self, cell: Size, start_index: Size = (0, 0)) -> Pair:
        """Return the center x, y [m] of one cell on the map; `centers` accepts several cells."""
        x, y = self._x, self._y
        row, column = (cell[0] - start_index[0]) % x.size, (cell[1] - start_index[1]) % y.size
        return x.center_of(row), y.center_of(column)

    def centers(self, cells: ArrayLike, start_index: Size = (0, 0)) -> Positions:
        """Return the centers of cells.

        Args:
            cells: buffer indices, as (rows, cols) or (N, 2).
            start_index: buffer index of cell (0, 0).

        Returns:
            (N, 2) x, y [m], map frame; (2,) for one cell.
        """
        cells = self.check_indices(cells)
        positions = np.empty((*cells[0].shape, 2))
        if 2 * cells[0].size <= sum(self.size):
            for number, axis in enumerate((self._x, self._y)):
                lines = (cells[number] - start_index[number]) % axis.size
                positions[..., number] = axis.center_of(lines)
            return positions
        axes = [*map(np.roll, self.axes_in_map_order(), start_index)]
        for part in slices(len(positions), PIECE):
            for number, centers in enumerate(axes):
                positions[part, number] = centers.take(cells[number][part], mode="clip")
        return positions

    def axes_in_map_order(self) -> tuple[Positions, Positions]:
        """Return the x of each row (rows,) and the y of each column (cols,) [m], both descending.

        `GridMap.axes` returns these coordinates in the order in which layers are stored.
        """
        rows, columns = self.size
        return self._x.centers(0, rows), self._y.centers(0, columns)

    @cached_property
    def negated_axes(self) -> tuple[Positions, Positions]:
        """Negated `axes_in_map_order`, ascending as `searchsorted` requires; read-only."""
        x, y = (-axis for axis in self.axes_in_map_order())
        x.flags.writeable = y.flags.writeable = False
        return x, y

    def check_indices(self, cells: ArrayLike, name: str = "index") -> Cells:
        """Convert cells (rows, cols) or (N, 2) to (rows, cols), and check them.

        Raises:
            OutOfMapError: a cell is outside the map.
        """
        cells = as_cells(cells, name)
        if not cells[0].size or all(
            # Viewed as unsigned integers, negative numbers also exceed `count`.
            int(numbers.view(np.uint64).max()) < count
            for numbers, count in zip(cells, self.size, strict=True)
        ):
            return cells
        pairs = np.stack(cells, axis=-1).reshape(-1, 2)
        outside = ((pairs < 0) | (pairs >= self.size)).any(axis=-1)
        found = tuple(pairs[outside][0].tolist())
        raise OutOfMapError(f"index {found} is outside the map of {self.size} cells")

    def box(self, lower: ArrayLike, upper: ArrayLike) -> tuple[slice, slice]:
        """Return the rows and columns of the cells that a rectangle overlaps, clipped to the map.

        A cell counts only if the rectangle extends into it by more than 1e-9 m. A rectangle without
        area overlaps the cell that contains it. If there is no overlap, both slices are empty.

        Args:
            lower: (2,) smallest x, y of the rectangle [m].
            upper: (2,) largest x, y of the rectangle [m].
        """
        (x_low, y_low), (x_high, y_high) = as_pair(lower, "lower"), as_pair(upper, "upper")
        rows, columns = self._x.overlapped(x_low, x_high), self._y.overlapped(y_low, y_high)
        if rows.start >= rows.stop or columns.start >= columns.stop:
            return slice(0, 0), slice(0, 0)
        return rows, columns

    def overlapped(self, position: ArrayLike, length: ArrayLike) -> tuple[slice, slice]:
        """Return the rows and columns of the cells that `GridMap.get_submap` copies."""
        center, sides = as_pair(position, "position"), as_pair(length, "length")
        (x, y), (length_x, length_y) = center, sides
        if length_x < 0 or length_y < 0:
            raise GeometryError(f"length: expected no negative numbers, got {sides}")
        half_x, half_y = 0.5 * length_x, 0.5 * length_y
        rows, columns = self.box((x - half_x, y - half_y), (x + half_x, y + half_y))
        if rows.start == rows.stop:
            raise OutOfMapError(
                f"the submap at {center} of length {sides} does not overlap the map: {self.place}"
            )
        return rows, columns

    def cropped(self, rows: slice, columns: slice) -> GridGeometry:
        """Return the geometry of a block of cells, given as slices in map order."""
        return self._of(
            self._x.block(rows.start, rows.stop), self._y.block(columns.start, columns.stop)
        )

    def closest_position(self, positions: ArrayLike) -> Positions:
        """Return the point on the map that is nearest to each position (..., 2) [m].

        Raises:
            GeometryError: a position contains NaN.
        """
        positions = as_positions(positions)
        if np.isnan(positions).any():
            raise GeometryError("position: NaN has no closest position in the map")
        lower, upper = zip(self._x.ends, self._y.ends, strict=True)
        clamped = np.clip(positions, lower, upper)
        return np.where(self.is_inside(positions)[..., None], positions, clamped)

    def index_shift(self, position: ArrayLike) -> Size:
        """Return the shift (rows, columns) that moves the map center closest to `position`.

        The shift is positive towards -x and -y. Halves of cells are rounded away from zero.
        """
        x, y = as_pair(position, "position")
        rows, columns = self._x.shift_to(x), self._y.shift_to(y)
        if not (abs(rows) < _LARGEST_SHIFT and abs(columns) < _LARGEST_SHIFT):
            raise GeometryError(f"position {tuple(np.asarray(position).tolist())} is too far away")
        return int(rows), int(columns)

    def shifted(self, shift: Size) -> GridGeometry:
        """Return the grid moved by `shift` (rows, columns), positive towards -x and -y."""
        return self._of(self._x.shifted(shift[0]), self._y.shifted(shift[1]))

    def __reduce__(self) -> tuple[object, ...]:
        # Default unpickling would return writable arrays.
        return GridGeometry, (self._sides, self.resolution, self._middle)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, GridGeometry) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def __repr__(self) -> str:
        return (
            f"GridGeometry(length={self._sides}, resolution={self.resolution}, "
            f"position={self._middle}, size={self.size})"
        )

    def _key(self) -> tuple[Size, float, Pair]:
        return self.size, self.resolution, self._middle

    def _set_up(self, x: Axis, y: Axis) -> None:
        fields = self.__dict__
        fields["_x"], fields["_y"] = x, y
        fields["size"], fields["resolution"] = (x.size, y.size), x.resolution

    @staticmethod
    def _of(x: Axis, y: Axis) -> GridGeometry:
        """Create a geometry from two axes, without checks."""
        result = object.__new__(GridGeometry)
        result._set_up(x, y)
        return result

    @property
    def _sides(self) -> Pair:
        return self._x.length, self._y.length

    @property
    def _middle(self) -> Pair:
        return self._x.center, self._y.center

    @cached_property
    def _both(self) -> Axis:
        return both_axes(self._x, self._y)

    @cached_property
    def _rounding(self) -> float:
        """Largest difference due to rounding between `Axis.steps` and `Axis.offset` [cells]."""
        return 4.0 * max(self._x.precision, self._y.precision) / self.resolution


def _read_only(pair: Pair) -> Positions:
    array = np.array(pair)
    array.flags.writeable = False
    return array
