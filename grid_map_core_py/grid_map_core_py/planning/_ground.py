# SPDX-License-Identifier: BSD-3-Clause
"""The ground that paths cross: free cells, costs, heights, and straight lines over them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Integers, Mask, Positions, Size, as_number
from ..errors import GeometryError, short
from ..map._geometry import GridGeometry
from ._footprint import Footprint, batches, kernel_of, touched_cells

Floats: TypeAlias = NDArray[np.float64]

BORDER = 2
"""Blocked cells around the map, so that every neighbor of a cell has a constant flat offset."""

ROUNDING = 1e-6
"""Tolerance of steps [m], slopes and cell borders [cells]; exceeds the rounding of float32."""

_AROUND = ROUNDING * np.array([[-1, -1, 1, 1], [-1, 1, 1, -1]])[..., np.newaxis, np.newaxis]
"""Offsets from a point on a border to all cells that touch it, in a ring of side neighbors."""


@dataclass(frozen=True)
class SlopeLimits:
    """Steepest slopes that a robot can travel [rad], from 0 to pi / 2, which means no limit.

    Attributes:
        up: slope along the path, upwards.
        down: slope along the path, downwards; also positive.
        cross: slope across the path, to either side.
    """

    up: float
    down: float
    cross: float

    def __post_init__(self) -> None:
        for name, angle in vars(self).items():
            if not 0.0 <= as_number(angle, name) <= math.pi / 2.0:
                text = f"{name}: expected an angle from 0 to pi / 2 [rad], got {short(angle)}"
                raise GeometryError(f"{text}. Convert degrees with math.radians")

    def _allow_along(self, rise: Floats, run: Floats | float) -> Mask:
        """Return whether the slope along lines is allowed; `rise` and `run` in meters."""
        up, down = (math.tan(limit) + ROUNDING for limit in (self.up, self.down))
        return (rise <= up * run) & (-rise <= down * run)

    def _allow_across(self, slope: Floats) -> Mask:
        """Return whether the tangent of the slope across a line is allowed."""
        return np.asarray(np.abs(slope) <= math.tan(self.cross) + ROUNDING)


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Flat arrays (S,) of a map in map order with a border of blocked cells.

    Points are in cells: (2.0, 3.0) is the center of row 2, column 3 of the map.

    Attributes:
        geometry, start_index: those of the map, without the border.
        known: cells with all data that the graph needs.
        passable: known, finite cells below the lethal cost.
        factor: cost per meter, at least 1.
        heights: [m], 0 where unknown; None on flat ground.
        gradient: (2, S) slope along the rows and along the columns.
        limits, max_step: steepest slopes (None for any), and largest step [m].
        footprint: None for a robot that fits into a cell.
        outside_is_free: whether the footprint may extend beyond the map.
    """

    geometry: GridGeometry
    start_index: Size
    known: Mask
    passable: Mask
    factor: Floats
    heights: Floats | None
    gradient: Floats
    limits: SlopeLimits | None
    max_step: float
    footprint: Footprint | None
    outside_is_free: bool

    @property
    def stride(self) -> int:
        """Flat offset from a row to the next one."""
        return self.geometry.size[1] + 2 * BORDER

    def flat(self, row: Any, column: Any) -> Any:
        """Return the flat index of a row and column in map order."""
        return (row + BORDER) * self.stride + (column + BORDER)

    def cells(self, flat: Any) -> Integers:
        """Return the rows and columns (2, ...) of flat indices."""
        return np.stack(np.divmod(flat, self.stride)) - BORDER

    def in_map_order(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return a view (rows, cols) of flat values, without the border."""
        return values.reshape(-1, self.stride)[BORDER:-BORDER, BORDER:-BORDER]

    def to_points(self, positions: Positions) -> Floats:
        """Convert positions (N, 2) [m] to points (2, N) [cells]."""
        return ((self.geometry.corner - positions) / self.geometry.resolution - 0.5).T

    def to_positions(self, points: Floats | Integers) -> Positions:
        """Convert points (2, N) [cells] to positions (N, 2) [m]."""
        return self.geometry.corner - (points.T + 0.5) * self.geometry.resolution

    def free_at(self, yaw: float) -> Mask:
        """Return the passable cells (S,) at whose center the footprint is free in a direction."""
        if self.footprint is None:
            return self.passable
        image = np.ascontiguousarray(self.in_map_order(self.passable).T).view(np.uint8)
        kernel = kernel_of(self.footprint, self.geometry.resolution, yaw)
        border = float(self.outside_is_free)
        free = cv2.erode(image, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=border)
        return self.passable & padded(free.T, 0).view(np.bool_)

    def _footprint_fits(self, points: Floats, yaws: Floats) -> Mask:
        """Return whether the footprint is free (P,) at points (2, P) in directions (P,) [rad]."""
        assert self.footprint is not None
        resolution = self.geometry.resolution
        fits, (rows, columns) = np.ones(len(yaws), np.bool_), self.geometry.size
        for part in batches(self.footprint, resolution, len(yaws)):
            origins = points[:, part].T + 0.5
            pose, row, column = touched_cells(self.footprint, resolution, origins, yaws[part])
            blocked = ~self.passable[self.flat(row.clip(-1, rows), column.clip(-1, columns))]
            if self.outside_is_free:
                blocked &= (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            fits[part.start + pose[blocked]] = False
        return fits

    def heights_at(self, points: Floats) -> Floats:
        """Return the heights (P,) [m] at points (2, P): bilinear over the passable cells."""
        if self.heights is None:
            return np.zeros(points.shape[1])
        base = np.floor(points)
        down, right = points - base
        corners = self.flat(*base.astype(np.int64)) + [[0], [1], [self.stride], [self.stride + 1]]
        shares = (1 - down) * (1 - right), (1 - down) * right, down * (1 - right), down * right
        weights = np.stack(shares) * self.passable[corners]
        heights: Floats = (weights * self.heights[corners]).sum(axis=0) / weights.sum(axis=0)
        return heights

    def straight(
        self, begin: Floats, end: Floats, most: Floats | float = math.inf
    ) -> tuple[Floats, Integers]:
        """Return the cost of each straight line, and the number of pieces to sample it with.

        Args:
            begin, end: (2, M) end points of the lines.
            most: (M,) or scalar maximum cost; more expensive lines are not allowed.

        Returns:
            costs: (M,) integral of the cost along each line; inf if the line is not allowed.
            pieces: (M,) number of equal pieces; the height is linear within a piece.
        """
        pieces = np.maximum(np.ceil(np.abs(end - begin).max(axis=0)), 1.0).astype(np.int64)
        points, extent, first = divided(begin, end, pieces)
        # Lines of no length, and heights over blocked cells only, are NaN and not allowed.
        with np.errstate(divide="ignore", invalid="ignore"):
            costs, allowed = self._over_pieces(points, extent)
        total = np.add.reduceat(costs, first)
        total[~(np.logical_and.reduceat(allowed, first) & (total <= most))] = np.inf
        if self.footprint is not None:
            tested = np.flatnonzero(np.isfinite(total))
            begin, end = begin[:, tested], end[:, tested]
            # At most half a cell apart, as in `check_path`.
            steps = np.ceil(2.0 * np.hypot(*(end - begin))).astype(np.int64)
            points, extent, first = divided(begin, end, steps)
            directions = np.append(extent, end - begin, axis=1)
            yaws = np.arctan2(-directions[1], -directions[0])
            fits = self._footprint_fits(np.append(points, end, axis=1), yaws)
            along, at_end = np.split(fits, [len(fits) - len(tested)])
            if tested.size:
                fits_along = np.logical_and.reduceat(along, first)
                total[tested[~(fits_along & at_end)]] = np.inf
        return total, pieces

    def _over_pieces(self, begin: Floats, extent: Floats) -> tuple[Floats, Mask]:
        """Return the costs (T,) of short pieces of lines, and whether they are allowed.

        A piece crosses at most one border of each axis, so it is in at most three cells.
        """
        end = begin + extent
        before, after = np.floor(begin + 0.5), np.floor(end + 0.5)
        crossing = (np.maximum(before, after) - 0.5 - begin) / extent
        early, late = np.sort(np.where(before == after, 1.0, crossing), axis=0)

        def cells(fractions: list[Floats], offsets: Any = 0.0) -> Any:
            """Return the flat indices of the cells at fractions of the pieces."""
            points = begin[:, np.newaxis] + extent[:, np.newaxis] * np.stack(fractions)
            return self.flat(*np.floor(points[:, np.newaxis] + (0.5 + offsets)).astype(np.int64))

        middles = cells([0.5 * early, 0.5 * (early + late), 0.5 * (late + 1.0)])[0]
        mean = (self.factor[middles] * [early, late - early, 1.0 - late]).sum(axis=0)
        touched = cells([early, late], _AROUND)
        allowed = self.passable[touched].all(axis=(0, 1))
        length = self.geometry.resolution * np.hypot(*extent)
        if self.heights is not None:
            rise = self.heights_at(end) - self.heights_at(begin)
            around = self.heights[touched]
            steps = np.abs(around - around[[1, 2, 3, 0]])
            allowed &= steps.max(axis=(0, 1)) <= self.max_step + ROUNDING
            if self.limits is not None:
                allowed &= self.limits._allow_along(rise, length)
                (rows, columns), (along, across) = self.gradient, extent / np.hypot(*extent)
                slope = rows[touched] * across - columns[touched] * along
                allowed &= self.limits._allow_across(slope).all(axis=(0, 1))
            length = np.hypot(length, rise)
        return length * mean, allowed


def divided(begin: Floats, end: Floats, pieces: Integers) -> tuple[Floats, Floats, Integers]:
    """Return the begins and extents (2, T) of equal pieces of lines, and each line's first piece.

    Args:
        begin, end: (2, M) ends of the lines.
        pieces: (M,) number of pieces of each line.
    """
    line, first = np.arange(len(pieces)).repeat(pieces), np.cumsum(pieces) - pieces
    extent = ((end - begin) / pieces)[:, line]
    return begin[:, line] + extent * (np.arange(line.size) - first[line]), extent, first


def padded(values: NDArray[Any], fill: Any) -> NDArray[Any]:
    """Return values (rows, cols) as a flat array (S,) with a border of `fill`."""
    return np.pad(values, BORDER, constant_values=fill).ravel()
