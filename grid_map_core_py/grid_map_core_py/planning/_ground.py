# SPDX-License-Identifier: BSD-3-Clause
"""The ground that paths cross: free cells, costs, heights, and straight lines over them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Integers, Mask, Positions, Size
from ..map._geometry import GridGeometry
from ._footprint import Footprint, free_poses

Floats: TypeAlias = NDArray[np.float64]

BORDER = 2
"""Blocked cells around the map, so that every neighbor of a cell has a constant flat offset."""

ROUNDING = 1e-6
"""Tolerance of steps [m], slopes and cell borders [cells]; exceeds the rounding of float32."""

VERTICAL = math.tan(math.pi / 2.0)
"""Tangent of a slope that means no limit; large, but finite."""


@dataclass(frozen=True, kw_only=True)
class Steepness:
    """Largest tangents of the slopes along and across a line, and largest step [m]."""

    up: float = VERTICAL
    down: float = VERTICAL
    cross: float = VERTICAL
    step: float = math.inf

    def allows(self, rise: Floats, run: Floats | float) -> Mask:
        """Return whether the slope along lines is allowed; `rise` and `run` in meters."""
        return (rise <= (self.up + ROUNDING) * run) & (-rise <= (self.down + ROUNDING) * run)


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Flat arrays (S,) of a map in map order with a border of blocked cells.

    Points are in cells: (2.0, 3.0) is the center of row 2, column 3 of the map.

    Attributes:
        geometry: geometry of the map, without the border.
        start_index: start index of the map, for results in buffer order.
        known: cells with all data that the graph needs.
        passable: known, finite cells below the lethal cost.
        factor: cost per meter, at least 1.
        is_flat: whether the map has no heights.
        heights: [m], 0 where unknown.
        gradient: (2, S) slope along the rows and along the columns; anything on flat ground.
        steepness: limits of slopes and steps.
        footprint: None for a robot that fits into a cell.
        outside_is_free: whether the footprint may extend beyond the map.
    """

    geometry: GridGeometry
    start_index: Size
    known: Mask
    passable: Mask
    factor: Floats
    is_flat: bool
    heights: Floats
    gradient: Floats
    steepness: Steepness
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

    def free_at(self, yaws: Floats) -> Mask:
        """Return where the footprint is free (N, S) in directions (N,) [rad]."""
        if self.footprint is None:
            return np.broadcast_to(self.passable, (len(yaws), self.passable.size))
        found = free_poses(
            self.in_map_order(self.passable),
            self.footprint,
            self.geometry.resolution,
            yaws.tolist(),
            outside_is_free=self.outside_is_free,
        )
        free = [padded(found[..., number], False) for number in range(len(yaws))]
        return np.stack(free) & self.passable

    @cached_property
    def _free_by_yaw(self) -> Mask:
        """Free cells (N, S) in N evenly spaced directions.

        The directions are so many that a corner moves by at most a quarter of a cell from any
        direction to the nearest of them.
        """
        if self.footprint is None:
            return self.passable[np.newaxis]
        count = math.ceil(4.0 * math.pi * self.footprint.radius / self.geometry.resolution)
        return self.free_at(np.linspace(0.0, 2.0 * math.pi, count, endpoint=False))

    def heights_at(self, points: Floats) -> Floats:
        """Return the heights (P,) [m] at points (2, P): bilinear over the passable cells."""
        if self.is_flat:
            return np.zeros(points.shape[1])
        corners, weights = self._corners(points)
        weights *= self.passable[corners]
        heights: Floats = (weights * self.heights[corners]).sum(axis=0) / weights.sum(axis=0)
        return heights

    def _corners(self, points: Floats) -> tuple[Integers, Floats]:
        """Return the four cells (4, P) around points (2, P), and their bilinear weights."""
        base = np.floor(points)
        cells, (down, right) = base.astype(np.int64), points - base
        corners = self.flat(*cells) + np.array([[0], [1], [self.stride], [self.stride + 1]])
        up, left = 1.0 - down, 1.0 - right
        return corners, np.stack([up * left, up * right, down * left, down * right])

    def straight(self, begin: Floats, end: Floats) -> tuple[Floats, Integers]:
        """Return the costs of straight lines, and the number of pieces to sample each in.

        Args:
            begin, end: (2, M) points on the map.

        Returns:
            costs: (M,) integral of the cost along each line; inf if the line is not allowed.
            pieces: (M,) number of equal pieces; the height is linear along each.
        """
        pieces = np.maximum(np.ceil(np.abs(end - begin).max(axis=0)), 1.0).astype(np.int64)
        points, line, first = sampled(begin, end, pieces)
        # Pieces of no length, and heights over blocked cells only, are NaN and not allowed.
        with np.errstate(divide="ignore", invalid="ignore"):
            costs, allowed = self._over_pieces(begin - end, line, points)
        # Each of these pairs is the last point of a line and the first point of the next one.
        joints = first[1:] - 1
        costs[joints], allowed[joints] = 0.0, True
        total = np.add.reduceat(costs, first)
        total[~np.logical_and.reduceat(allowed, first)] = np.inf
        return total, pieces

    def _over_pieces(
        self, direction: Floats, line: Integers, points: Floats
    ) -> tuple[Floats, Mask]:
        """Return the costs (P - 1,) of the pieces between points, and whether they are allowed."""
        extent = np.diff(points)
        crossing = _Crossing.of(self, points, extent)
        run = self.geometry.resolution * np.hypot(*extent)
        allowed = self._is_free(direction, line, points, crossing)
        if not self.is_flat:
            rise = np.diff(self.heights_at(points))
            allowed &= self._is_gentle(rise, run, extent, crossing)
            run = np.hypot(run, rise)
        return run * crossing.mean(self.factor), allowed

    def _is_free(
        self, direction: Floats, line: Integers, points: Floats, crossing: _Crossing
    ) -> Mask:
        if self.footprint is None:
            return crossing.all_touched(self.passable[crossing.cells])
        tables = self._free_by_yaw
        turns = np.arctan2(direction[1], direction[0]) / (2.0 * math.pi)
        number = np.rint(turns * len(tables)).astype(np.int64)[line] % len(tables)
        free = crossing.all_touched(tables[number[:-1], crossing.cells])
        # The footprint at a point touches only cells that it touches at one of these corners.
        corners, weights = self._corners(points)
        is_free = (tables[number, corners] | (weights <= ROUNDING)).all(axis=0)
        free &= is_free[:-1] & is_free[1:]
        return free

    def _is_gentle(self, rise: Floats, run: Floats, extent: Floats, crossing: _Crossing) -> Mask:
        limits = self.steepness
        gentle: Mask = limits.allows(rise, run)
        if limits.cross < VERTICAL:
            (along_rows, along_columns), cells = self.gradient, crossing.cells
            rows, columns = extent * (self.geometry.resolution / run)
            slope = along_rows[cells] * columns - along_columns[cells] * rows
            gentle &= crossing.all_touched(np.abs(slope) <= limits.cross + ROUNDING)
        if math.isfinite(limits.step):
            gentle &= crossing.steps(self.heights) <= limits.step + ROUNDING
        return gentle


@dataclass(frozen=True, kw_only=True, eq=False)
class _Crossing:
    """Cells that short pieces of lines touch; a piece crosses at most one border of each axis.

    Attributes:
        cells: (4, T) cells of both ends, and the two cells that complete the rectangle.
        avoided: (4, T) whether the piece does not touch a cell, not even its corner.
        at: (2, T) fraction of the piece at which it enters the next row, and the next column; 1 if
            it stays.
    """

    cells: Integers
    avoided: Mask
    at: Floats

    @classmethod
    def of(cls, ground: Ground, points: Floats, extent: Floats) -> _Crossing:
        places = np.floor(points + (0.5 + ROUNDING)).astype(np.int64)
        before, after = places[:, :-1], places[:, 1:]
        borders = np.maximum(before, after) - 0.5
        at = np.where(before == after, 1.0, (borders - points[:, :-1]) / extent)
        flat = ground.flat(*places)
        jump = (after[0] - before[0]) * ground.stride
        avoided = np.zeros((4, len(jump)), np.bool_)
        np.greater(at, at[::-1] + ROUNDING, out=avoided[2:])
        cells = np.stack([flat[:-1], flat[1:], flat[:-1] + jump, flat[1:] - jump])
        return cls(cells=cells, avoided=avoided, at=at)

    def all_touched(self, good: Mask) -> Mask:
        """Return whether all touched cells are good; `good` is (4, T) like `cells`."""
        found: Mask = np.logical_and.reduce(good | self.avoided)
        return found

    def mean(self, values: Floats) -> Floats:
        """Return the means (T,) of cell values along each piece."""
        here, there, *beside = values[self.cells]
        early, late = np.minimum(*self.at), np.maximum(*self.at)
        middle = np.where(self.at[0] < self.at[1], *beside)
        means: Floats = here * early + middle * (late - early) + there * (1.0 - late)
        return means

    def steps(self, heights: Floats) -> Floats:
        """Return the largest step (T,) between neighboring cells that each piece touches."""
        of_cells = heights[self.cells]
        steps = np.abs(of_cells[2:, np.newaxis] - of_cells[:2]).max(axis=1)
        highest: Floats = np.where(self.avoided[2:], 0.0, steps).max(axis=0)
        return highest


def sampled(begin: Floats, end: Floats, pieces: Integers) -> tuple[Floats, Integers, Integers]:
    """Return the ends of equal pieces of lines, one line after the other.

    Args:
        begin, end: (2, M) ends of the lines.
        pieces: (M,) number of pieces of each line.

    Returns:
        points: (2, P) both ends included.
        line: (P,) number of the line of each point.
        first: (M,) number of the first point of each line.
    """
    line = np.arange(len(pieces)).repeat(pieces + 1)
    first = np.cumsum(pieces + 1) - pieces - 1
    fraction = (np.arange(line.size) - first[line]) / pieces[line]
    return begin[:, line] + (end - begin)[:, line] * fraction, line, first


def padded(values: NDArray[Any], fill: Any) -> NDArray[Any]:
    """Return values (rows, cols) as a flat array (S,) with a border of `fill`."""
    rows, columns = values.shape
    result = np.full((rows + 2 * BORDER, columns + 2 * BORDER), fill, values.dtype)
    result[BORDER:-BORDER, BORDER:-BORDER] = values
    return result.ravel()
