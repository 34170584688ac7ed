# SPDX-License-Identifier: BSD-3-Clause
"""Free cells, costs and heights of the ground, and straight lines across it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Integers, Mask, Positions, as_number
from ..errors import GeometryError, short
from ..map._geometry import GridGeometry
from ._footprint import Footprint, kernel_of, touched_cells

Floats: TypeAlias = NDArray[np.float64]

BORDER = 2  # blocked cells around the map, which give every neighbor a constant flat offset
ROUNDING = 1e-6  # tolerance of steps [m], slopes and cell borders [cells], for float32
EQUAL = 1e-9  # relative difference of costs, or distance [cells], due to rounding

# Offsets from a point on a border to all cells that touch it, in a ring of side neighbors.
_AROUND = ROUNDING * np.array([[-1, -1, 1, 1], [-1, 1, 1, -1]])[..., np.newaxis, np.newaxis]


@dataclass(frozen=True)
class SlopeLimits:
    """Steepest slopes that a robot can travel [rad], from 0 to pi / 2 (no limit).

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

    def _allow(self, rise: Floats, run: Floats | float, across: Floats) -> Mask:
        """Return a mask (L,) of the lines with allowed slopes; `across` (N, L) are tangents."""
        up, down, cross = (math.tan(angle) + ROUNDING for angle in (self.up, self.down, self.cross))
        is_level = np.abs(across).max(axis=0) <= cross
        return np.asarray((rise <= up * run) & (-rise <= down * run) & is_level)


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Cells of a map and its border, as flat arrays (S,) in map order.

    Points are given in cells: (2.0, 3.0) is the center of row 2, column 3 of the map.

    Attributes:
        geometry: geometry of the map, without the border.
        passable: mask of the cells with a finite height and a cost below the lethal cost.
        open: mask of the cells that the footprint may touch: the passable cells, and the border if
            the robot may leave the map.
        factor: cost per meter, at least 1.
        is_flat: whether all heights are 0.
        heights: heights [m]; NaN where unknown.
        limits: steepest slopes; None for no limit.
        max_step: largest step [m].
        footprint: outline of the robot; None if the robot fits into a cell.
    """

    geometry: GridGeometry
    passable: Mask
    open: Mask
    factor: Floats
    is_flat: bool
    heights: Floats
    limits: SlopeLimits | None
    max_step: float
    footprint: Footprint | None

    @property
    def stride(self) -> int:
        """Distance between successive rows in the flat arrays."""
        return self.geometry.size[1] + 2 * BORDER

    def flat(self, row: Any, column: Any) -> Any:
        """Return the flat index of a row and column in map order."""
        return (row + BORDER) * self.stride + (column + BORDER)

    def cells(self, flat: Any) -> Integers:
        """Return the rows and columns (2, ...) of flat indices."""
        return np.stack(np.divmod(flat, self.stride)) - BORDER

    def to_points(self, positions: Positions) -> Floats:
        """Convert positions (N, 2) [m] to points (2, N) [cells]."""
        return ((self.geometry.corner - positions) / self.geometry.resolution - 0.5).T

    def to_positions(self, points: Floats | Integers) -> Positions:
        """Convert points (2, N) [cells] to positions (N, 2) [m]."""
        return self.geometry.corner - (points.T + 0.5) * self.geometry.resolution

    def free_at(self, yaw: float) -> Mask:
        """Return a mask (S,) of the cells at which a footprint with `yaw` is free."""
        if self.footprint is None:
            return self.passable
        free = cv2.erode(
            self.open.reshape(-1, self.stride).view(np.uint8),
            kernel_of(self.footprint, self.geometry.resolution, yaw),
            borderType=cv2.BORDER_CONSTANT,
            borderValue=float(self.open[0]),
        )
        return self.passable & free.view(np.bool_).ravel()

    def blocked_at(self, poses: Positions) -> Mask:
        """Return a mask (P,) of the poses at which the footprint touches a blocked cell."""
        blocked, size = np.zeros(len(poses), np.bool_), np.array(self.geometry.size)
        if self.footprint is not None:
            for batch, pose, cells in touched_cells(self.footprint, self.geometry, poses):
                row, column = cells.clip(-1, size[:, np.newaxis])
                blocked[batch][pose[~self.open[self.flat(row, column)]]] = True
        return blocked

    def heights_at(self, points: Floats) -> Floats:
        """Return the heights (P,) [m] at points (2, P), interpolated between passable cells."""
        if self.is_flat:
            return np.zeros(points.shape[1])
        base = np.floor(points)
        down, right = points - base
        corners = self.flat(*base.astype(np.int64)) + [[0], [1], [self.stride], [self.stride + 1]]
        shares = (1 - down) * (1 - right), (1 - down) * right, down * (1 - right), down * right
        passable = self.passable[corners]
        weights = np.stack(shares) * passable
        heights = weights * np.where(passable, self.heights[corners], 0.0)
        return np.asarray(heights.sum(axis=0) / weights.sum(axis=0))

    @cached_property
    def _gradient(self) -> Floats:
        """Slopes (2, S) along rows and columns; 0 where both neighbors are unknown."""
        gradient = []
        for lag in self.stride, 1:
            steps = self.heights[lag:] - self.heights[:-lag]
            both = np.stack([steps[:-lag], steps[lag:]])
            count = np.isfinite(both).sum(axis=0).clip(1)
            gradient.append(np.pad(np.nan_to_num(both).sum(axis=0) / count, lag))
        return np.stack(gradient) / self.geometry.resolution

    def move_costs(self, move: tuple[int, int], free: Mask) -> Floats:
        """Return the cost (S,) of a move by (rows, columns) from each cell; 0 if not allowed."""
        (i, j), margin = move, self.flat(0, 0)

        def at(values: Any, cell: tuple[int, int]) -> Any:
            """Return the values at the offset `cell` (rows, columns) from each start of a move."""
            offset = margin + self.stride * cell[0] + cell[1]
            return values[offset : values.size - 2 * margin + offset]

        ends = (0, 0), move
        # The cells that touch the middle of the move are those that it passes between.
        cells = sorted({*ends, *product({i // 2, -(-i // 2)}, {j // 2, -(-j // 2)})})
        exists = np.logical_and.reduce([at(self.passable, cell) for cell in cells])
        exists &= at(free, (0, 0)) & at(free, move)
        for a, b in combinations(cells, 2):
            if math.dist(a, b) == 1.0 and math.isfinite(self.max_step):
                step = at(self.heights, a) - at(self.heights, b)
                exists &= np.abs(step) <= self.max_step + ROUNDING
        rise, length = at(self.heights, move) - at(self.heights, (0, 0)), math.hypot(i, j)
        run = length * self.geometry.resolution
        if self.limits is not None:
            across = (self._gradient[0] * j - self._gradient[1] * i) / length
            exists &= self.limits._allow(rise, run, np.stack([at(across, end) for end in ends]))
        weighted = cells if max(abs(i), abs(j)) == 2 else ends
        mean = sum(at(self.factor, cell) for cell in weighted) / len(weighted)
        return np.pad(np.where(exists, np.hypot(run, rise) * mean, 0.0), margin)

    def straight(
        self, begin: Floats, end: Floats, most: Floats | float = math.inf
    ) -> tuple[Floats, Floats]:
        """Return the cost of each straight line, and the number of equal pieces it is divided into.

        The cost is infinite if a line is not allowed, costs more than `most`, or has no length.

        Args:
            begin, end: (2, M) end points of the lines [cells].
            most: largest cost of an allowed line, (M,) or scalar.
        """
        pieces = np.maximum(np.ceil(np.abs(end - begin).max(axis=0) - EQUAL), 1.0)
        points, extent, line = divided(begin, end, pieces)
        # Lines of no length, and heights over blocked cells only, are NaN and not allowed.
        with np.errstate(divide="ignore", invalid="ignore"):
            costs, allowed = self._over_pieces(points, extent)
        total: Floats = np.bincount(line, costs, len(pieces)).astype(np.float64, copy=False)
        total[line[~allowed]] = np.inf
        total[~(total <= most)] = np.inf
        if self.footprint is not None:
            tested = np.flatnonzero(np.isfinite(total))
            begin, end = begin[:, tested], end[:, tested]
            # At most half a cell apart, as in `check_path`. The ends of all pieces are tested.
            parts = pieces[tested]
            steps = parts * np.ceil(2.0 * np.hypot(*(end - begin)) / parts - EQUAL)
            points, _, line = divided(begin, end, steps)
            points, line = np.append(points, end, axis=1), np.append(line, np.arange(tested.size))
            yaws = np.arctan2(*(begin - end)[::-1])[line]
            poses = np.column_stack([self.to_positions(points), yaws])
            total[tested[line[self.blocked_at(poses)]]] = np.inf
        return total, pieces

    def _over_pieces(self, begin: Floats, extent: Floats) -> tuple[Floats, Mask]:
        """Return the costs (T,) of pieces up to one cell long, and a mask of the allowed pieces."""
        end = begin + extent
        before, after = np.floor(begin + 0.5), np.floor(end + 0.5)
        crossing = (np.maximum(before, after) - 0.5 - begin) / extent
        # A piece crosses at most one border of each axis, so it is in at most three cells.
        early, late = np.sort(np.where(before == after, 1.0, crossing), axis=0)

        def cells(fractions: list[Floats], offsets: Any = 0.0) -> Any:
            """Return flat indices of cells at fractions along each piece, shifted by `offsets`."""
            points = begin[:, np.newaxis] + extent[:, np.newaxis] * np.stack(fractions)
            return self.flat(*np.floor(points[:, np.newaxis] + (0.5 + offsets)).astype(np.int64))

        middles = cells([0.5 * early, 0.5 * (early + late), 0.5 * (late + 1.0)])[0]
        mean = (self.factor[middles] * [early, late - early, 1.0 - late]).sum(axis=0)
        touched, length = cells([early, late], _AROUND), np.hypot(*extent)
        allowed = self.passable[touched].all(axis=(0, 1)) & (length > 0.0)
        low, high = self.heights_at(np.append(begin, end, axis=1)).reshape(2, -1)
        rise, run = high - low, self.geometry.resolution * length
        if math.isfinite(self.max_step):
            around = self.heights[touched]
            steps = np.abs(around - around[[1, 2, 3, 0]]).max(axis=(0, 1))
            allowed &= steps <= self.max_step + ROUNDING
        if self.limits is not None:
            (rows, columns), (along, across) = self._gradient, extent / length
            slopes = rows[touched] * across - columns[touched] * along
            allowed &= self.limits._allow(rise, run, slopes.reshape(8, -1))
        return np.hypot(run, rise) * mean, allowed

    def shortened(self, points: Floats, lines: Floats, tested: Mask) -> tuple[Floats, Floats]:
        """Drop each waypoint if a straight line between its neighbors does not cost more.

        Args:
            points: (2, K) waypoints [cells].
            lines: (2, K - 1) cost and number of pieces of each line, as returned by `straight`.
            tested: (K,) mask of waypoints that are tested only if a neighbor is dropped.
        """
        odd, tested[[0, -1]] = 0, True
        # Waypoints that are not neighbors are independent, so every other one is tested at once.
        while not tested.all():
            odd = 1 - odd
            here = 2 * np.flatnonzero(~tested[odd::2]) + odd
            if not here.size:
                continue
            tested[here] = True
            most = (lines[0, here - 1] + lines[0, here]) * (1.0 + EQUAL)
            straight = np.stack(self.straight(points[:, here - 1], points[:, here + 1], most))
            drops = np.isfinite(straight[0])
            here, keep = here[drops], np.ones(len(tested), np.bool_)
            lines[:, here - 1], keep[here] = straight[:, drops], False
            tested[here - 1] = tested[here + 1] = False
            tested[[0, -1]] = True
            points, lines, tested = points[:, keep], lines[:, keep[:-1]], tested[keep]
        return points, lines


def divided(begin: Floats, end: Floats, pieces: Floats) -> tuple[Floats, Floats, Integers]:
    """Divide each line from `begin` to `end` (D, M) into `pieces` (M,) equal pieces.

    Returns:
        begin, extent: (D, N) start and extent of each piece, line by line.
        line: (N,) index of the line that contains each piece.
    """
    line = np.arange(len(pieces)).repeat(pieces.astype(np.int64))
    number = np.arange(line.size) - (np.cumsum(pieces) - pieces)[line]
    extent = ((end - begin) / pieces)[:, line]
    return begin[:, line] + extent * number, extent, line
