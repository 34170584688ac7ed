# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Where the cells of a map lie: the arithmetic between positions and cells.

Cells are counted here from the corner with the largest x and y, rows towards -x and columns towards
-y, as if the map had never moved. Where a cell is stored is the business of `ring_buffer`.
"""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from .arrays import Cells, Mask, Positions, Size, as_cells, as_number, as_pair, as_positions
from .errors import GeometryError, OutOfMapError

BORDER_TOLERANCE = 1e-9
"""Metres by which an edge or a rim may miss a border or a cell centre and still count as on it."""

_LARGEST_SIDE = 2**31
"""Cells; beyond it, layers could not be addressed anyway."""

_LARGEST_SHIFT = 2.0**52
"""Cells; beyond it, single cells make no difference to a coordinate any more."""


@dataclass(frozen=True, eq=False)
class GridGeometry:
    """Size, resolution and place of a grid; an immutable value.

    Args:
        length: (2,) side lengths along x and y [m]; rounded to whole cells.
        resolution: side of a cell [m].
        position: (2,) centre of the map [m], map frame.

    Raises:
        GeometryError: a length or the resolution is not positive and finite, or a side has no cell.
    """

    length: Positions
    resolution: float
    position: Positions = field(default_factory=lambda: np.zeros(2))
    size: Size = field(init=False)

    def __post_init__(self) -> None:
        length = as_pair(self.length, "length")
        resolution = as_number(self.resolution, "resolution")
        if not (math.isfinite(resolution) and resolution > 0):
            raise GeometryError(f"resolution: expected a positive number, got {self.resolution!r}")
        if not (length > 0).all():
            raise GeometryError(f"length: expected positive numbers, got {tuple(length.tolist())}")
        # The quotient is positive: adding a half and flooring rounds half away from zero.
        with np.errstate(over="ignore"):
            size = np.floor(length / resolution + 0.5)
        if not (size >= 1).all():
            raise GeometryError(
                f"length {tuple(length.tolist())} m is less than half a cell of {resolution} m"
            )
        if not (size <= _LARGEST_SIDE).all():
            raise GeometryError(
                f"length {tuple(length.tolist())} m has too many cells of {resolution} m"
            )
        self._set("resolution", resolution)
        self._set("size", (int(size[0]), int(size[1])))
        self._set("length", _frozen(size * resolution))
        self._set("position", _frozen(as_pair(self.position, "position")))

    @classmethod
    def from_size(
        cls, size: Size, resolution: float, position: npt.ArrayLike = (0.0, 0.0)
    ) -> "GridGeometry":
        """Return the geometry with `size` rows and columns of cells."""
        return cls(np.asarray(size) * float(resolution), resolution, as_pair(position, "position"))

    def at(self, position: npt.ArrayLike) -> "GridGeometry":
        """Return the same grid centred on another position."""
        return GridGeometry(self.length, self.resolution, as_pair(position, "position"))

    @property
    def corner(self) -> Positions:
        """(2,) the corner with the largest x and y [m], where cell (0, 0) lies."""
        return self.position + 0.5 * self.length

    def is_inside(self, positions: npt.ArrayLike) -> Mask:
        """Tell which positions lie on the map.

        The +x and +y borders belong to the map, the -x and -y borders do not.

        Args:
            positions: (..., 2) x, y [m], map frame; NaN is outside.

        Returns:
            (...) bool.
        """
        return np.asarray(np.logical_and(*self._within(as_positions(positions))).all(axis=-1))

    def cells_at(self, positions: npt.ArrayLike) -> tuple[Cells, Mask]:
        """Return the cell under each position and whether the position is on the map.

        Args:
            positions: (..., 2) x, y [m], map frame.

        Returns:
            cells: (..., 2) row, column; for a position outside, the border cell nearest along each
                axis.
            inside: (...) bool.
        """
        positions = as_positions(positions)
        rows_columns = self._offsets(positions) / self.resolution
        # A position within rounding of the far border would give an index one too large.
        bounded = np.clip(np.nan_to_num(rows_columns, nan=0.0), 0, np.subtract(self.size, 1))
        return bounded.astype(np.int64), self.is_inside(positions)

    def centres(self, cells: npt.ArrayLike) -> Positions:
        """Return the centres of cells.

        Args:
            cells: (..., 2) row, column.

        Returns:
            (..., 2) x, y [m], map frame.

        Raises:
            OutOfMapError: a cell lies outside the map.
        """
        cells = as_cells(cells)
        self.check_cells(cells)
        return self.position + 0.5 * (self.length - self.resolution) - self.resolution * cells

    def axes(self) -> tuple[Positions, Positions]:
        """Return the x of every row (rows,) and the y of every column (cols,) [m]; both descend."""
        first = self.position + 0.5 * (self.length - self.resolution)
        x, y = (first[axis] - self.resolution * np.arange(self.size[axis]) for axis in (0, 1))
        return x, y

    def check_cells(self, cells: Cells) -> None:
        """Raise `OutOfMapError` naming the first of the (..., 2) cells that is not on the map."""
        outside = np.logical_or(cells < 0, cells >= self.size).any(axis=-1)
        if outside.any():
            found = tuple(cells.reshape(-1, 2)[outside.reshape(-1)][0].tolist())
            raise OutOfMapError(f"index {found} is outside the map of {self.size} cells")

    def box(self, lower: npt.ArrayLike, upper: npt.ArrayLike) -> tuple[slice, slice]:
        """Return the rows and columns of the cells that a rectangle overlaps, clipped to the map.

        An edge within 1e-9 m of a cell border takes no further cell; a rectangle without area takes
        the cell that it lies in. Outside the map both slices are empty.

        Args:
            lower: (2,) smallest x, y of the rectangle [m].
            upper: (2,) largest x, y of the rectangle [m].
        """
        near = self._offsets(as_pair(upper, "upper")) / self.resolution
        far = self._offsets(as_pair(lower, "lower")) / self.resolution
        tolerance = BORDER_TOLERANCE / self.resolution
        first = np.floor(near + tolerance)
        last = np.maximum(np.ceil(far - tolerance) - 1, first)
        start = np.clip(first, 0, self.size).astype(int)
        stop = np.clip(last + 1, 0, self.size).astype(int)
        if (start >= stop).any():
            return slice(0, 0), slice(0, 0)
        return slice(int(start[0]), int(stop[0])), slice(int(start[1]), int(stop[1]))

    def cropped(self, rows: slice, columns: slice) -> "GridGeometry":
        """Return the geometry of a block of cells of this grid."""
        first = np.array([rows.start, columns.start])
        size = (rows.stop - rows.start, columns.stop - columns.start)
        centre = self.corner - self.resolution * (first + 0.5 * np.array(size))
        return GridGeometry.from_size(size, self.resolution, centre)

    def closest_position(self, positions: npt.ArrayLike) -> Positions:
        """Return each position itself when it is on the map, else the nearest one that is.

        Args:
            positions: (..., 2) x, y [m], map frame.

        Returns:
            (..., 2); every one passes `is_inside` and has a cell.
        """
        positions = as_positions(positions)
        if np.isnan(positions).any():
            raise GeometryError("position: NaN has no closest position in the map")
        lower, upper = self._innermost_bounds()
        clamped = np.clip(positions, lower, upper)
        return np.where(self.is_inside(positions)[..., None], positions, clamped)

    def bound_position_to_range(self, positions: npt.ArrayLike) -> Positions:
        """Clamp positions onto the border, then nudge them inside.

        The nudge is 10 machine epsilons times the larger of 1 and the magnitude of the coordinate.
        """
        positions = as_positions(positions)
        epsilon = 10 * np.finfo(np.float64).eps * np.maximum(1.0, np.abs(positions))
        shifted = positions - self.position + 0.5 * self.length
        low, high = shifted <= 0, shifted >= self.length
        bounded = np.where(low, epsilon, np.where(high, self.length - epsilon, shifted))
        return bounded + self.position - 0.5 * self.length

    def index_shift(self, position: npt.ArrayLike) -> Size:
        """Return by how many rows and columns the map moves to come nearest to `position`.

        Rounded half away from zero per axis; positive towards +row, that is towards -x.
        """
        cells = (as_pair(position, "position") - self.position) / self.resolution
        shift = -np.copysign(np.floor(np.abs(cells) + 0.5), cells)
        if not (np.abs(shift) < _LARGEST_SHIFT).all():
            raise GeometryError(f"position {tuple(np.asarray(position).tolist())} is too far away")
        return int(shift[0]), int(shift[1])

    def shifted(self, shift: Size) -> "GridGeometry":
        """Return the grid moved by whole cells, as counted by `index_shift`."""
        return self.at(self.position - self.resolution * np.array(shift))

    def __reduce__(self) -> tuple[object, ...]:
        # Otherwise the arrays of a copy could be written into.
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

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    # A position on a cell border must fall to the same side as in the C++ library, which rounds
    # these two differences in different orders.

    def _offsets(self, positions: Positions) -> Positions:
        """(..., 2) metres from the corner to positions, growing with row and column."""
        return -(positions - 0.5 * self.length - self.position)

    def _within(self, positions: Positions) -> tuple[Mask, Mask]:
        """(..., 2) whether each coordinate keeps the +x, +y border, and the -x, -y border."""
        offsets = 0.5 * self.length - (positions - self.position)
        return offsets >= 0.0, offsets < self.length

    def _innermost_bounds(self) -> tuple[Positions, Positions]:
        """Return about the smallest and largest coordinates that are inside on each axis.

        They miss the borders by what rounding takes from a sum of position and length. The step
        inwards is of that size too: the next number after a border at 0 would change no such sum.
        """
        lower, upper = self.position - 0.5 * self.length, self.corner
        step = np.spacing(np.abs(self.position) + self.length)
        while not (inside := self._within(lower)[1]).all():
            lower = np.where(inside, lower, lower + step)
        while not (inside := self._within(upper)[0]).all():
            upper = np.where(inside, upper, upper - step)
        return lower, upper


def _frozen(values: Positions) -> Positions:
    values.flags.writeable = False
    return values
