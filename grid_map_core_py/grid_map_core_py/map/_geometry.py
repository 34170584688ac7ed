# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Geometry of a grid: conversion between positions and cell indices.

Cells are counted here from the corner with the largest x and y, rows towards -x and columns towards
-y, as if the map had never moved. `_ring_buffer` knows where a cell is stored.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..arrays._checks import (
    Cells,
    Mask,
    Positions,
    Size,
    as_cells,
    as_finite,
    as_number,
    as_pair,
    as_positions,
    as_size,
    as_text,
)
from ..arrays._pieces import PIECE, slices
from ..errors import GeometryError, OutOfMapError
from . import _ring_buffer as ring_buffer

BORDER_TOLERANCE = 1e-9
"""Tolerance [m] within which an edge or a rim counts as on a cell border or a cell center."""

# Largest number [m] that is too small for a resolution, because such numbers lose digits.
_SUBNORMAL = float(np.nextafter(np.finfo(np.float64).tiny, 0.0))

_LARGEST_SIDE = 2**31  # largest number of cells along a side; larger layers cannot be addressed
_LARGEST_SHIFT = 2.0**52  # largest shift [cells]; beyond it, float64 cannot count single cells


@dataclass(frozen=True, eq=False)
class GridGeometry:
    """Size, resolution and place of a grid; immutable.

    Args:
        length: (2,) side lengths along x and y [m]; rounded to whole cells.
        resolution: side of a cell [m].
        position: (2,) center of the map [m], map frame.

    Raises:
        GeometryError: a length or the resolution is not positive and finite, or a side has no cell.
    """

    length: Positions
    resolution: float
    position: Positions = field(default_factory=lambda: np.zeros(2))
    size: Size = field(init=False)

    def __post_init__(self) -> None:
        length = as_pair(self.length, "length")
        resolution = as_finite(self.resolution, "resolution", "a positive number", above=_SUBNORMAL)
        # For two numbers, plain Python is several times faster than NumPy.
        x, y = sides = tuple(length.tolist())
        if not min(sides) > 0:
            raise GeometryError(f"length: expected positive numbers, got {sides}")
        # The quotient is positive: adding a half and truncating rounds half away from zero.
        rows, columns = x / resolution + 0.5, y / resolution + 0.5
        if not min(rows, columns) >= 1:
            raise GeometryError(
                f"length: expected at least half a cell of {resolution} m, got {sides}"
            )
        if not max(rows, columns) < _LARGEST_SIDE + 1:
            raise GeometryError(
                f"length: expected at most 2**31 cells of {resolution} m, got {sides}"
            )
        size = int(rows), int(columns)
        self._set_up(size, resolution, as_pair(self.position, "position"))

    @classmethod
    def from_size(
        cls, size: Size, resolution: float, position: ArrayLike = (0.0, 0.0)
    ) -> GridGeometry:
        """Return the geometry with `size` rows and columns of cells."""
        length = np.multiply(as_size(size, "size"), as_number(resolution, "resolution"))
        return cls(length, resolution, as_pair(position, "position"))

    def at(self, position: ArrayLike) -> GridGeometry:
        """Return the same grid centered on another position."""
        return GridGeometry(self.length, self.resolution, as_pair(position, "position"))

    @property
    def place(self) -> str:
        """Center and length as text, for error messages."""
        return f"center {as_text(self.position)}, length {as_text(self.length)}"

    @property
    def corner(self) -> Positions:
        """(2,) the corner with the largest x and y [m], where cell (0, 0) lies."""
        return self.position + 0.5 * self.length

    def is_inside(self, positions: ArrayLike) -> Mask:
        """Return a mask of the positions inside the map.

        The +x and +y borders belong to the map, the -x and -y borders do not.

        Args:
            positions: (..., 2) x, y [m], map frame; NaN is outside.

        Returns:
            (...) bool.
        """
        positions = as_positions(positions)
        points = positions.reshape(-1, 2)
        inside = np.empty(len(points), dtype=np.bool_)
        with np.errstate(over="ignore"):
            for part in slices(len(points), PIECE):
                borders = (*self._within(points[part, 0], 0), *self._within(points[part, 1], 1))
                np.logical_and.reduce(borders, out=inside[part])
        return inside.reshape(positions.shape[:-1])

    def cells_at(self, positions: ArrayLike, start_index: Size = (0, 0)) -> tuple[Cells, Mask]:
        """Return the cell under each position and whether the position is on the map.

        Args:
            positions: (..., 2) x, y [m], map frame.
            start_index: place of cell (0, 0) in the circular buffer; cells are buffer indices.

        Returns:
            cells: (rows, cols), each (...) int64; for a position outside, the border cell nearest
                along each axis.
            inside: (...) bool.
        """
        positions = as_positions(positions)
        points = positions.reshape(-1, 2)
        cells = np.empty((2, len(points)), dtype=np.int64)
        inside = np.ones(len(points), dtype=np.bool_)
        # Overflow makes a coordinate infinite, which is outside as well.
        with np.errstate(over="ignore"):
            for part in slices(len(points), PIECE):
                for axis, size in enumerate(self.size):
                    # Rounded as in the C++ library; `_within` subtracts in another order.
                    steps = points[part, axis] - self._half[axis]
                    steps -= self.position[axis]
                    steps /= -self.resolution
                    # Checking all cells at once is faster than searching for the few outside.
                    if not (steps.min() > self._rounding and steps.max() < size - self._rounding):
                        inside[part] &= np.logical_and(*self._within(points[part, axis], axis))
                        # NaN becomes 0. A position within rounding of the far border can lie
                        # beyond it.
                        np.fmax(steps, 0.0, out=steps)
                        np.minimum(steps, size - 1, out=steps)
                    found = cells[axis, part]
                    found[...] = steps
                    if start_index[axis]:
                        ring_buffer.place(found, 0, start_index[axis], size)
        rows, columns = cells.reshape(2, *positions.shape[:-1])
        return (rows, columns), inside.reshape(positions.shape[:-1])

    def centers(self, cells: ArrayLike, start_index: Size = (0, 0)) -> Positions:
        """Return the centers of cells.

        Args:
            cells: (rows, cols), or (N, 2).
            start_index: place of cell (0, 0) in the circular buffer; cells are buffer indices.

        Returns:
            (N, 2) x, y [m], map frame; (2,) for one cell.

        Raises:
            OutOfMapError: a cell is outside the map.
        """
        cells = as_cells(cells)
        positions = np.empty((*cells[0].shape, 2))
        if 2 * cells[0].size <= sum(self.size):
            self.check_cells(cells)
            for axis, numbers in enumerate(cells):
                steps = (numbers - start_index[axis]) % self.size[axis]
                positions[..., axis] = self._first[axis] - self.resolution * steps
            return positions
        x, y = map(np.roll, self.axes_in_map_order(), start_index)
        table, begins = np.concatenate((x, y)), (0, x.size)
        entries = np.empty((min(len(positions), PIECE), 2), np.int64)
        for part in slices(len(positions), PIECE):
            chosen = entries[: part.stop - part.start]
            for axis, begin in enumerate(begins):
                found = cells[axis][part]
                # Checking each piece in the cache is faster than checking all cells at once.
                if found.view(np.uint64).max() >= self.size[axis]:
                    self.check_cells(cells)
                np.add(found, begin, out=chosen[:, axis])
            table.take(chosen, out=positions[part], mode="clip")
        return positions

    def axes_in_map_order(self) -> tuple[Positions, Positions]:
        """Return the x of every row (rows,) and the y of every column (cols,) [m], both descending.

        Layers of a map that has not moved are stored in this order;
        `GridMap.axes` gives the order of every map.
        """
        x, y = (self._first[axis] - self.resolution * np.arange(self.size[axis]) for axis in (0, 1))
        return x, y

    def check_cells(self, cells: ArrayLike, name: str = "index") -> Cells:
        """Return cells as (rows, cols) that are on the map.

        Args:
            cells: (rows, cols), or (N, 2).
            name: name of the parameter, for the message.

        Raises:
            OutOfMapError: a cell is outside the map; the message names the first one.
            GeometryError: the cells are no integers or have another shape.
        """
        cells = as_cells(cells, name)
        if not cells[0].size or all(
            # As unsigned integers, negative numbers are too large as well.
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

        An edge within 1e-9 m of a cell border adds no further cell; a rectangle without area takes
        the cell that it is in. Outside the map both slices are empty.

        Args:
            lower: (2,) smallest x, y of the rectangle [m].
            upper: (2,) largest x, y of the rectangle [m].
        """
        low, high = as_pair(lower, "lower").tolist(), as_pair(upper, "upper").tolist()
        rows, columns = (self._span(axis, low[axis], high[axis]) for axis in (0, 1))
        if rows.start >= rows.stop or columns.start >= columns.stop:
            return slice(0, 0), slice(0, 0)
        return rows, columns

    def cropped(self, rows: slice, columns: slice) -> GridGeometry:
        """Return the geometry of a block of cells of this grid."""
        first = np.array([rows.start, columns.start])
        size = (rows.stop - rows.start, columns.stop - columns.start)
        return self._derived(size, self.corner - self.resolution * (first + 0.5 * np.array(size)))

    def closest_position(self, positions: ArrayLike) -> Positions:
        """Return each position, or the nearest one on the map if it is outside.

        Args:
            positions: (..., 2) x, y [m], map frame.

        Returns:
            (..., 2); every one passes `is_inside` and has a cell.
        """
        positions = as_positions(positions)
        if np.isnan(positions).any():
            raise GeometryError("position: NaN has no closest position in the map")
        # About the smallest and largest coordinates inside: they differ from the borders by the
        # rounding error of a sum of position and length. The step inwards has that size too: a
        # smaller step would not change such a sum.
        lower, upper = self.position - self._half, self.corner
        step, both = np.spacing(np.abs(self.position) + self.length), slice(None)
        while not (inside := self._within(lower, both)[1]).all():
            lower = np.where(inside, lower, lower + step)
        while not (inside := self._within(upper, both)[0]).all():
            upper = np.where(inside, upper, upper - step)
        clamped = np.clip(positions, lower, upper)
        return np.where(self.is_inside(positions)[..., None], positions, clamped)

    def index_shift(self, position: ArrayLike) -> Size:
        """Return the shift in rows and columns that brings the map nearest to `position`.

        Rounded half away from zero per axis; positive towards +row, that is towards -x.
        """
        cells = (as_pair(position, "position") - self.position) / self.resolution
        shift = -np.copysign(np.floor(np.abs(cells) + 0.5), cells)
        if not (np.abs(shift) < _LARGEST_SHIFT).all():
            raise GeometryError(f"position {tuple(np.asarray(position).tolist())} is too far away")
        return int(shift[0]), int(shift[1])

    def shifted(self, shift: Size) -> GridGeometry:
        """Return the grid moved by whole cells, as counted by `index_shift`."""
        return self._derived(self.size, self.position - self.resolution * np.array(shift))

    def __reduce__(self) -> tuple[object, ...]:
        # Unpickled by default, the arrays would be writable.
        return GridGeometry, (self.length, self.resolution, self.position)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, GridGeometry) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def __repr__(self) -> str:
        return (
            f"GridGeometry(length={tuple(self.length.tolist())}, resolution={self.resolution}, "
            f"position={tuple(self.position.tolist())}, size={self.size})"
        )

    def _key(self) -> tuple[Size, float, tuple[float, ...]]:
        return self.size, self.resolution, tuple(self.position.tolist())

    def _set_up(self, size: Size, resolution: float, position: Positions) -> None:
        length = np.multiply(size, resolution)
        length.flags.writeable = position.flags.writeable = False
        values = {"length": length, "resolution": resolution, "position": position, "size": size}
        self.__dict__.update(values)

    def _derived(self, size: Size, position: Positions) -> GridGeometry:
        """Return a grid of the same cells without the checks, which would take most of the time."""
        result = object.__new__(GridGeometry)
        result._set_up(size, self.resolution, position)
        return result

    def _span(self, axis: int, lower: float, upper: float) -> slice:
        """Return the slice of cells along an axis that an interval overlaps; it may be empty."""
        half, center, size = self._half[axis], self.position[axis], self.size[axis]
        tolerance = BORDER_TOLERANCE / self.resolution
        # For far positions, the number of cells may be infinite.
        near = max((upper - half - center) / -self.resolution + tolerance, -1.0)
        far = min((lower - half - center) / -self.resolution - tolerance, size + 1.0)
        first = math.floor(min(near, size + 1.0))
        stop = max(math.ceil(max(far, -1.0)), first + 1)
        return slice(min(max(first, 0), size), min(max(stop, 0), size))

    def _within(self, values: Positions, axis: int | slice) -> tuple[Mask, Mask]:
        """Return which coordinates are within the +x, +y border, and within the -x, -y border.

        Rounded as in the C++ library, so that a position on a cell border falls to the same side.
        """
        half = self._half[axis]
        offsets = half - (values - self.position[axis])
        return offsets >= 0.0, offsets < 2.0 * half

    @cached_property
    def _rounding(self) -> float:
        """Bound of the difference between the two roundings [cells]."""
        return float(4.0 * np.spacing(np.abs(self.position) + self.length).max() / self.resolution)

    @cached_property
    def _first(self) -> Positions:
        """Center of cell (0, 0) [m]."""
        return self.position + 0.5 * (self.length - self.resolution)

    @cached_property
    def _half(self) -> Positions:
        return 0.5 * self.length
