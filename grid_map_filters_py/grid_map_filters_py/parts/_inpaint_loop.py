# SPDX-License-Identifier: BSD-3-Clause
"""Compiled loop for inpainting, with the bits of `cv2.inpaint` of OpenCV 5.

Bertalmio, Bertozzi and Sapiro, "Navier-Stokes, Fluid Dynamics, and Image and Video Inpainting"
(2001), as OpenCV approximates it: holes are filled from their rim inwards, in the order of fast
marching (Sethian 1996). A cell becomes a weighted mean of the known and filled cells around it.
Weights fall with the distance, and grow where the image changes across the line to the cell.

Images have a frame of unused cells, as wide as the neighborhood. All arrays are flat.
"""

import math
from typing import Any

import numpy as np

from grid_map_core_py._loops import loop

_ZERO, _TWO, _HIGHEST = np.float32(0), np.float32(2), 255.0
_NAN, _UNKNOWN = np.float32(np.nan), np.float32(np.inf)

_OUTSIDE = np.float32(1e6)
"""Arrival time of cells outside of the image."""

_FLAT, _WEIGHT_OF_FLAT, _LEAST_WEIGHT = np.float32(0.01), np.float32(1e-6), np.float32(1e-20)
"""Change up to which a direction counts as flat, its weight, and what the sum of weights exceeds.

These are OpenCV's, for gray values from 0 to 255.
"""


def _arrival(times: Any, one: Any, other: Any) -> Any:
    """Return the time at which a front arrives from two neighbors of a cell, at right angles."""
    first, second = np.float64(times[one]), np.float64(times[other])
    difference = first - second
    if abs(difference) < 1.0:
        return np.float32((first + second + math.sqrt(2.0 - difference * difference)) * 0.5)
    return np.float32(1.0 + min(first, second))


def _earliest(times: Any, cell: Any, width: Any) -> Any:
    above, below, left, right = cell - width, cell + width, cell - 1, cell + 1
    return min(
        min(_arrival(times, above, left), _arrival(times, below, left)),
        min(_arrival(times, above, right), _arrival(times, below, right)),
    )


def _change(before: Any, here: Any, after: Any, has_before: Any, has_after: Any) -> Any:
    """Return how much gray values change from cell to cell, in both directions together."""
    change = (abs(after - here) if has_after else _ZERO) + (
        abs(here - before) if has_before else _ZERO
    )
    return change if has_before and has_after else change * _TWO


def _put_changes(
    images: Any, cell: Any, width: Any, top: Any, bottom: Any, left: Any, right: Any
) -> None:
    """Write how gray values change at a cell, across rows and along its row.

    `top`, `bottom`, `left` and `right` are 1 at that border of the image, else 0. There OpenCV
    reads values one cell further inside.
    """
    grays, times, across, along = images
    row, column = cell + top * width, cell + left
    middle = column - bottom * width
    change_across = _change(
        grays[column + (top - 1) * width],
        grays[middle],
        grays[middle + width],
        times[cell - width] != _UNKNOWN,
        times[cell + width] != _UNKNOWN,
    )
    change_along = _change(
        grays[row + left - 1],
        grays[row + left],
        grays[row - right + 1],
        times[cell - 1] != _UNKNOWN,
        times[cell + 1] != _UNKNOWN,
    )
    is_unknown = times[cell] == _UNKNOWN
    across[cell] = _NAN if is_unknown else change_across
    along[cell] = _NAN if is_unknown else change_along


def _put_changes_near(
    images: Any, cell: Any, width: Any, row: Any, column: Any, rows: Any, columns: Any
) -> None:
    """Update the changes at a cell and its neighbors."""
    if 1 < row < rows - 2 and 1 < column < columns - 2:
        for step in (0, -width, width, -1, 1):
            _put_changes(images, cell + step, width, 0, 0, 0, 0)
        return
    for y in range(max(row - 1, 0), min(row + 2, rows)):
        for x in range(max(column - 1, 0), min(column + 2, columns)):
            _put_changes(
                images,
                cell + (y - row) * width + x - column,
                width,
                np.int64(y == 0),
                np.int64(y == rows - 1),
                np.int64(x == 0),
                np.int64(x == columns - 1),
            )


def _estimate(images: Any, cell: Any, disc: Any, offsets: Any, count: Any) -> Any:
    """Return the gray value of a cell from the known cells of the disc around it."""
    grays, _, across, along = images
    x, y, squares, nearness, weights = disc
    for i in range(count):
        place = cell + offsets[i]
        # The gradient turned by a right angle, along which gray values continue.
        change = abs(y[i] * along[place] - x[i] * across[place])
        size = across[place] * across[place] + along[place] * along[place]
        share = change / np.sqrt(squares[i] * size)
        weight = nearness[i] * (_WEIGHT_OF_FLAT if change <= _FLAT else share)
        # Cells that are unknown or outside have NaN.
        weights[i] = _ZERO if np.isnan(change) else weight
    total, all_weights = _ZERO, _LEAST_WEIGHT
    for i in range(count):
        total += weights[i] * grays[cell + offsets[i]]
        all_weights += weights[i]
    return np.float32(np.float64(total) / np.float64(all_weights))


def _push(queue: Any, times: Any, size: Any, cell: Any, number: Any) -> None:
    """Add a cell to a heap of `size` cells, whose first cell has the earliest time.

    Cells of equal time have the order of their numbers; the new number is the highest.
    """
    cells, numbers = queue
    place, parent = size, (size - 1) // 2
    while place > 0 and times[cells[parent]] > times[cell]:
        cells[place], numbers[place] = cells[parent], numbers[parent]
        place, parent = parent, (parent - 1) // 2
    cells[place], numbers[place] = cell, number


def _is_first(queue: Any, times: Any, one: Any, cell: Any, number: Any) -> Any:
    cells, numbers = queue
    time = times[cells[one]]
    return time < times[cell] or (time == times[cell] and numbers[one] < number)


def _pop(queue: Any, times: Any, size: Any) -> Any:
    """Remove and return the first cell of a heap of `size` cells."""
    cells, numbers = queue
    first, last = cells[0], size - 1
    cell, number = cells[last], numbers[last]
    place, child = 0, 1
    while child < last:
        other = child + 1
        if other < last and _is_first(queue, times, other, cells[child], numbers[child]):
            child = other
        if not _is_first(queue, times, child, cell, number):
            break
        cells[place], numbers[place] = cells[child], numbers[child]
        place, child = child, 2 * child + 1
    cells[place], numbers[place] = cell, number
    return first


def _prepare(images: Any, frame: Any, scaling: Any) -> None:
    """Make gray values of heights, and write the other images."""
    grays, times, across, along = images
    lowest, scale = scaling
    rows, columns, margin = frame
    width = columns + 2 * margin
    for i in range((rows + 2 * margin) * width):
        times[i] = _OUTSIDE
        across[i] = along[i] = _NAN
    for row in range(rows):
        start = (row + margin) * width + margin
        for cell in range(start, start + columns):
            is_finite = grays[cell] - grays[cell] == _ZERO
            gray = np.float32((np.float64(grays[cell]) - lowest) * scale)
            grays[cell] = gray if is_finite else _ZERO
            times[cell] = _ZERO if is_finite else _UNKNOWN
    for row in range(rows):
        start = (row + margin) * width + margin
        top, bottom = np.int64(row == 0), np.int64(row == rows - 1)
        _put_changes(images, start, width, top, bottom, 1, 0)
        if top or bottom:
            for cell in range(start + 1, start + columns - 1):
                _put_changes(images, cell, width, top, bottom, 0, 0)
        else:
            for cell in range(start + 1, start + columns - 1):
                _put_changes(images, cell, width, 0, 0, 0, 0)
        _put_changes(images, start + columns - 1, width, top, bottom, 0, 1)


def _has_unknown_neighbor(times: Any, cell: Any, width: Any) -> Any:
    # The sum of all four is infinity if one of them is.
    return times[cell - width] + times[cell + width] + times[cell - 1] + times[cell + 1] == _UNKNOWN


def _fill_around(task: Any, middle: Any, queued: Any, number: Any) -> Any:
    """Fill the neighbors of a cell: above, left, below, right.

    Takes the arguments of `inpaint`, and returns how many cells are in the queue and the number of
    the next one.
    """
    images, frame, scaling, disc, offsets, count, queue, chosen, heights = task
    grays, times, _, _ = images
    rows, columns, margin = frame
    lowest, scale = scaling
    width = columns + 2 * margin
    for cell in (middle - width, middle - 1, middle + width, middle + 1):
        if times[cell] != _UNKNOWN:
            continue
        time = _earliest(times, cell, width)
        grays[cell] = _estimate(images, cell, disc, offsets, count)
        times[cell] = time
        row, column = cell // width - margin, cell % width - margin
        _put_changes_near(images, cell, width, row, column, rows, columns)
        if _has_unknown_neighbor(times, cell, width):
            _push(queue, times, queued, cell, number)
            queued, number = queued + 1, number + 1
        if chosen[column * rows + row]:
            gray = min(max(np.float64(grays[cell]), 0.0), _HIGHEST)
            heights[column * rows + row] = np.float32(gray / scale + lowest)
    return queued, number


@loop(
    ("float32*", 4),
    ("int64", 3),
    ("float64", 2),
    ("float32*", 5),
    "int64*",
    "int64",
    ("int64*", 2),
    "uint8*",
    "float32*",
)
def inpaint(
    images: Any,
    frame: Any,
    scaling: Any,
    disc: Any,
    offsets: Any,
    count: Any,
    queue: Any,
    chosen: Any,
    heights: Any,
) -> None:
    """Fill the chosen cells of a layer that are not finite.

    Args:
        images: the heights, in a frame of zeros, and three images of memory.
        frame: rows and columns of the layer, each at least 3, and width of the frame.
        scaling: lowest height, and gray values per height.
        disc: x, y, x^2 + y^2 and 1 / ((x^2 + y^2)^2 + 1) of the cells of a disc, row after row,
            and memory for a number for each.
        offsets: places of these cells in an image, relative to the middle.
        count: number of these cells.
        queue: memory for two numbers for each cell that is not finite.
        chosen: 1 for cells to fill, column after column.
        heights: the layer, column after column; is written to.
    """
    task = images, frame, scaling, disc, offsets, count, queue, chosen, heights
    rows, columns, margin = frame
    width, times = columns + 2 * margin, images[1]
    _prepare(images, frame, scaling)
    queued, number = np.int64(0), np.int64(0)
    # The cells around holes come first, row after row.
    for row in range(rows):
        start = (row + margin) * width + margin
        for cell in range(start, start + columns):
            if times[cell] == _ZERO and _has_unknown_neighbor(times, cell, width):
                queued, number = _fill_around(task, cell, queued, number)
    while queued > 0:
        cell = _pop(queue, times, queued)
        queued, number = _fill_around(task, cell, queued - 1, number)
