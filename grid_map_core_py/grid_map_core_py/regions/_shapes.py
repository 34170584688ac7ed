# SPDX-License-Identifier: BSD-3-Clause
"""Cells in rectangles, discs, ellipses and polygons and on lines, and masks of cells."""

from __future__ import annotations

import math
import warnings

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import (
    Cells,
    Integers,
    Mask,
    Pair,
    Positions,
    Size,
    as_finite,
    as_pair,
    as_size,
)
from .._arrays._pieces import slices
from ..errors import GeometryError, OutOfMapError, short
from ..map._axis import BORDER_TOLERANCE
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..map._ring_buffer import lines, place
from ._polygon import Polygon, edge_x

_BAND = 2**13  # cells per band; its temporaries fit into the cache
_FLIP = np.uint8(1)  # same type as the array, which avoids a conversion


def map_cells(grid_map: GridMap) -> Cells:
    """Return all cells (rows, cols) of a map in buffer order, column by column."""
    rows, columns = grid_map.size
    cells = empty_cells(rows * columns)
    cells[0].reshape(columns, rows)[...] = np.arange(rows)
    cells[1].reshape(columns, rows)[...] = np.arange(columns)[:, None]
    return cells


def submap_cells(grid_map: GridMap, start_index: ArrayLike, size: ArrayLike) -> Cells:
    """Return the cells (rows, cols) of a rectangular block, row by row in map order.

    Cells of the block beyond the map are omitted.

    Args:
        start_index: buffer index of the block's cell with the largest x and y.
        size: number of rows and columns of the block.
    """
    start, extent = as_size(start_index, "start_index"), as_size(size, "size")
    grid_map.geometry.check_indices(start)
    if min(extent) < 0:
        raise GeometryError(f"size: expected no negative numbers, got {extent}")
    rows, columns = (
        lines(cells, cell)[: min(count, cells - (cell - first) % cells)]
        for count, cell, first, cells in zip(
            extent, start, grid_map.start_index, grid_map.size, strict=True
        )
    )
    return rows.repeat(columns.size), columns[np.newaxis].repeat(rows.size, axis=0).ravel()


def cells_to_mask(grid_map: GridMap, cells: ArrayLike) -> Mask:
    """Return a mask (rows, cols) that is True at `cells` and False elsewhere.

    Masks combine with `&`, `|` and `~`:

        ring = cells_to_mask(grid_map, circle_cells(grid_map, (0, 0), 2.0))
        ring &= ~cells_to_mask(grid_map, circle_cells(grid_map, (0, 0), 1.0))
        grid_map["elevation"][ring] = np.nan

    Args:
        cells: buffer indices, as a tuple (rows, cols) such as from `circle_cells`, or as (N, 2).
    """
    chosen = grid_map.geometry.check_indices(cells, "cells")
    mask: Mask = np.zeros(grid_map.size, dtype=np.bool_, order="F")
    mask[chosen] = True
    return mask


def circle_cells(grid_map: GridMap, center: ArrayLike, radius: float) -> Cells:
    """Return the cells (rows, cols) whose centers are in a disc, row by row.

    A center within 1e-9 m of the edge counts as inside.

    Args:
        center: (2,) center of the disc [m]; it may be outside the map.
        radius: radius of the disc [m], not negative.
    """
    limit, (x, y) = checked_radius(radius), as_pair(center, "center")
    geometry = grid_map.geometry
    rows, _ = geometry.box((x - limit, y - limit), (x + limit, y + limit))
    of_rows, of_columns = geometry.negated_axes
    half = half_chords(limit, of_rows[rows] + x)
    first = of_columns.searchsorted(-y - half, side="left")
    stop = of_columns.searchsorted(half - y, side="right")
    # For rows that do not touch the disc, the half chord is negative and the run is empty.
    counts, columns = _runs(first, np.maximum(first, stop))
    (row, column), (height, width) = grid_map.start_index, grid_map.size
    place(columns, column, width)
    return lines(height, row)[rows].repeat(counts), columns


def half_chords(radius: float, distances: Positions) -> Positions:
    """Return half the length of each line's chord in a disc; negative if the line misses the disc.

    Args:
        radius: positive radius. To count cell centers on the edge, add `BORDER_TOLERANCE` [m].
        distances: (...) distances from the center to the lines, in the unit of the radius.
    """
    # Dividing by the radius first keeps the squares from overflowing.
    across = distances / radius
    rest = (1.0 - across) * (1.0 + across)
    return radius * np.copysign(np.sqrt(np.abs(rest)), rest)


def ellipse_cells(
    grid_map: GridMap, center: ArrayLike, length: ArrayLike, rotation: float = 0.0
) -> Cells:
    """Return the cells (rows, cols) whose centers are in an ellipse, row by row.

    Let u and v be the offsets of a cell center from the center of the ellipse, along its axes. The
    cell is inside if u^2 / (length_x / 2)^2 + v^2 / (length_y / 2)^2 <= 1, without a tolerance.

    Args:
        center: (2,) center of the ellipse [m]; it may be outside the map.
        length: (2,) lengths of the full axes [m], along x and y before the rotation. If a length is
            0, the function returns no cells.
        rotation: counter-clockwise rotation [rad]; the function warns if abs(rotation) > 2 pi.
    """
    center = np.array(as_pair(center, "center"))
    half_axes = 0.5 * np.array(as_pair(length, "length"))
    if (half_axes < 0).any():
        raise GeometryError(f"length: expected no negative numbers, got {short(length)}")
    angle = as_finite(rotation, "rotation", "a finite angle [rad]")
    if abs(angle) > 2.0 * math.pi:
        text = f"rotation: expected an angle from -2 pi to 2 pi [rad], got {angle:g}"
        warnings.warn(f"{text}. Convert degrees with math.radians", stacklevel=2)
    cosine, sine = math.cos(angle), math.sin(angle)
    (a, b), (squared_a, squared_b) = half_axes, half_axes**2
    reach = np.hypot((a * cosine, a * sine), (b * sine, b * cosine))
    reach += BORDER_TOLERANCE
    rows, columns = grid_map.geometry.box(center - reach, center + reach)
    # Negating both coordinates does not change which cells are in the ellipse.
    x, y = grid_map.geometry.negated_axes
    x, y = x[rows, None] + center[0], y[columns] + center[1]
    mask: Mask = np.empty((x.size, y.size), dtype=np.bool_)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        for band in slices(x.size, _BAND // max(y.size, 1)):
            along, across = cosine * x[band] + sine * y, sine * x[band] - cosine * y
            mask[band] = along**2 / squared_a + across**2 / squared_b <= 1.0
    return _cells_of_mask(grid_map, rows, columns, mask)


def polygon_cells(grid_map: GridMap, polygon: Polygon | ArrayLike) -> Cells:
    """Return the cells (rows, cols) whose centers are inside a polygon, row by row.

    Args:
        polygon: a `Polygon`, or (V, 2) vertices [m]. `Polygon.is_inside` defines which centers are
            inside. For fewer than three vertices, the function warns and returns no cells.
    """
    polygon = Polygon.of(polygon)
    if len(polygon) < 3:
        text = (
            f"polygon: expected at least 3 vertices [m], got {len(polygon)}, without a cell inside"
        )
        warnings.warn(f"{text}. Use line_cells or Polygon.thicken_line for a line", stacklevel=2)
        return empty_cells(0)
    rows, columns = grid_map.geometry.box(*polygon._ends)
    x, y = grid_map.geometry.negated_axes
    x, y = x[rows], y[columns]
    first_below, crossed = _crossings(polygon, x, y)
    # Scan conversion: where an edge crosses a column, flip the column's cells with smaller x.
    flips = np.zeros((x.size + 1, y.size), dtype=np.uint8)
    np.add.at(flips.reshape(-1), first_below * y.size + crossed, _FLIP)
    np.add.accumulate(flips, axis=0, dtype=np.uint8, out=flips)
    flips &= _FLIP
    return _cells_of_mask(grid_map, rows, columns, flips[:-1].view(np.bool_))


def _crossings(polygon: Polygon, x: Positions, y: Positions) -> tuple[Integers, Integers]:
    """Return where the edges of a polygon cross the columns of a grid.

    As in `Polygon.is_inside`, an edge crosses a column if exactly one end has a greater y.

    Args:
        x, y: (rows,) and (columns,) negated coordinates of the cells [m], ascending.

    Returns:
        first_below: (N,) first row with a smaller x (before negation) than each crossing.
        crossed: (N,) column of each crossing.
    """
    vertices = -polygon._closed.T
    below = y.searchsorted(vertices[1], side="right")
    before, after = below[:-1], below[1:]
    counts, crossed = _runs(np.minimum(before, after), np.maximum(before, after))
    start, end = vertices[:, 1:].repeat(counts, axis=1), vertices[:, :-1].repeat(counts, axis=1)
    return x.searchsorted(edge_x(start, end, y.take(crossed)), side="right"), crossed


def line_cells(grid_map: GridMap, start: ArrayLike, end: ArrayLike) -> Cells:
    """Return the cells (rows, cols) along a line, from start to end.

    The line is clipped to the map. Bresenham's algorithm then connects the cells at both ends of
    the clipped line. Both of these cells are included.

    Args:
        start, end: (2,) ends of the line [m]; they may be outside the map.

    Raises:
        OutOfMapError: the line does not touch the map.
    """
    geometry, ends = grid_map.geometry, (as_pair(start, "start"), as_pair(end, "end"))
    first, last = (geometry.cell_at(position) for position in ends)
    if first is None or last is None:
        first, last = _clipped(geometry, *ends)
    return _drawn(grid_map, first, last)


def line_cells_between(grid_map: GridMap, start_index: ArrayLike, end_index: ArrayLike) -> Cells:
    """Return the cells (rows, cols) on the line from one cell to another, including both ends."""
    ends = as_size(start_index, "start_index"), as_size(end_index, "end_index")
    for cell in ends:
        grid_map.geometry.check_indices(cell)
    (row, column), (rows, columns) = grid_map.start_index, grid_map.size
    first, last = (((i - row) % rows, (j - column) % columns) for i, j in ends)
    return _drawn(grid_map, first, last)


def _drawn(grid_map: GridMap, first: Size, last: Size) -> Cells:
    """Return the buffer cells of Bresenham's line between two cells of the map."""
    steps = last[0] - first[0], last[1] - first[1]
    longer = max(abs(steps[0]), abs(steps[1]))
    rows, columns = _taken(steps[0], longer), _taken(steps[1], longer)
    rows += first[0]
    columns += first[1]
    place(rows, grid_map.start_index[0], grid_map.size[0])
    place(columns, grid_map.start_index[1], grid_map.size[1])
    return rows, columns


def _taken(steps: int, longer: int) -> Integers:
    # After k of n steps on the longer axis, (n // 2 + k * m) // n of m steps are taken.
    direction = -1 if steps < 0 else 1
    if abs(steps) == longer:
        return np.arange(0, steps + direction, direction)
    taken = np.arange(longer + 1)
    taken *= abs(steps)
    taken += longer // 2
    taken //= longer
    return taken if steps > 0 else -taken


def _clipped(geometry: GridGeometry, start: Pair, end: Pair) -> tuple[Size, Size]:
    """Return the first and last cell of a line clipped to the map (Liang-Barsky algorithm)."""
    on_map = geometry.contains(start), geometry.contains(end)
    enters, leaves = 0.0, 1.0
    lower = (geometry.position - 0.5 * geometry.length).tolist()
    upper = geometry.corner.tolist()
    for a, b, low, high in zip(start, end, lower, upper, strict=True):
        # The difference of two large numbers may overflow; the difference of their halves cannot.
        extent = 0.5 * b - 0.5 * a
        if extent:
            cuts = sorted((0.5 * border - 0.5 * a) / extent for border in (low, high))
            enters, leaves = max(enters, cuts[0]), min(leaves, cuts[1])
        elif not (low <= a <= high or any(on_map)):
            enters, leaves = 1.0, 0.0
    # Rounding may move an end from the border to the outside.
    if on_map[0]:
        enters, leaves = 0.0, max(leaves, 0.0)
    elif on_map[1]:
        enters, leaves = min(enters, 1.0), 1.0
    if enters <= leaves:
        fractions = np.array([[enters], [leaves], [0.5 * (enters + leaves)]])
        points = (1.0 - fractions) * start + fractions * end
        (rows, columns), found = geometry.cells_at(points)
        # Both ends may be on the -x and -y borders, which are outside the map. Test the middle.
        if found.any():
            first, last, _ = zip(rows.tolist(), columns.tolist(), strict=True)
            return first, last
    raise OutOfMapError(f"the line from {start} to {end} does not touch the map: {geometry.place}")


def _runs(first: Integers, stop: Integers) -> tuple[Integers, Integers]:
    """Return lengths (R,) and concatenated numbers of ranges from `first` to `stop` - 1."""
    counts = stop - first
    ends = np.add.accumulate(counts)
    numbers = np.arange(ends.item(-1) if ends.size else 0)
    numbers += (stop - ends).repeat(counts)
    return counts, numbers


def _cells_of_mask(grid_map: GridMap, rows: slice, columns: slice, mask: Mask) -> Cells:
    (row, column), (height, width) = grid_map.start_index, grid_map.size
    # These views are faster than `broadcast_to`.
    row_of = np.ndarray(mask.shape, np.int64, lines(height, row)[rows], strides=(8, 0))
    column_of = np.ndarray(mask.shape, np.int64, lines(width, column)[columns], strides=(0, 8))
    return row_of[mask], column_of[mask]


def empty_cells(count: int) -> Cells:
    rows, columns = np.empty((2, count), dtype=np.int64)
    return rows, columns


def checked_radius(radius: float) -> float:
    """Check a radius [m], and return it enlarged by `BORDER_TOLERANCE`."""
    return as_finite(radius, "radius", least=0.0) + BORDER_TOLERANCE
