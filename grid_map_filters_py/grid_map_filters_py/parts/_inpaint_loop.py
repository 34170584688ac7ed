# SPDX-License-Identifier: BSD-3-Clause
"""Compiled version of `cv2.inpaint`, up to 50 times as fast as OpenCV 4.6 on maps with many holes.

The method is from Bertalmio, Bertozzi and Sapiro, "Navier-Stokes, Fluid Dynamics, and Image and
Video Inpainting" (2001), with the fast marching method of Sethian (1996).

The private functions expect images that are padded with one cell on all sides.
"""

import math
from heapq import heappop, heappush
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Mask
from grid_map_core_py._loops import loop

_ZERO, _ONE, _UNKNOWN = np.float32(0), np.float32(1), np.float32(np.inf)
_OUTSIDE = np.float32(1e6)  # arrival time of cells outside the image
# OpenCV constants for gray values from 0 to 255: largest `change` at which a cell counts as flat,
# weight factor of a flat cell, and initial value of the sum of weights.
_FLAT, _WEIGHT_OF_FLAT, _LEAST_WEIGHT = np.float32(0.01), np.float32(1e-6), np.float32(1e-20)


def inpainted(
    image: npt.NDArray[np.float32], missing: Mask, radius: float
) -> npt.NDArray[np.float32] | None:
    """Inpaint like `cv2.inpaint` with `cv2.INPAINT_NS`; return None if numba is not available.

    The image must have at least 3 x 3 cells, and `radius` must be from 1 to 100 cells.
    """
    run = _inpaint.compiled()
    if run is None:
        return None
    grays = np.pad(image, 1)
    times = np.pad(np.where(missing, _UNKNOWN, _ZERO), 1, constant_values=_OUTSIDE)
    run((grays, times), (*image.shape, min(round(radius), sum(image.shape))))
    return grays[1:-1, 1:-1]


def _change(before: Any, here: Any, after: Any, has_before: Any, has_after: Any) -> Any:
    """Sum the absolute differences to two neighbors; if one is unknown, double the other one."""
    change = (abs(after - here) if has_after else _ZERO) + (
        abs(here - before) if has_before else _ZERO
    )
    return change if has_before and has_after else change + change


def _estimate(images: Any, frame: Any, row: Any, column: Any) -> Any:
    """Estimate the gray value of a cell from the known cells in the surrounding disc."""
    grays, times = images
    rows, columns, reach = frame
    width = columns + 2
    first = width + 1
    total, weights = _ZERO, _LEAST_WEIGHT
    for y in range(max(row - reach, 0), min(row + reach + 1, rows)):
        for x in range(max(column - reach, 0), min(column + reach + 1, columns)):
            square = (y - row) ** 2 + (x - column) ** 2
            cell = first + y * width + x
            if square > reach * reach or times[np.uintp(cell)] == _UNKNOWN:
                continue
            # Unsigned indices avoid numba's slow check for negative indices. At image
            # borders, OpenCV uses the changes of the next cell further inside.
            inner_column, inner_row = first + max(x, 1), first + max(y, 1) * width
            across = _change(
                grays[np.uintp(inner_column + max(y - 1, 0) * width)],
                grays[np.uintp(inner_column + min(y, rows - 2) * width)],
                grays[np.uintp(inner_column + min(y + 1, rows - 1) * width)],
                times[np.uintp(cell - width)] != _UNKNOWN,
                times[np.uintp(cell + width)] != _UNKNOWN,
            )
            along = _change(
                grays[np.uintp(inner_row + max(x - 1, 0))],
                grays[np.uintp(inner_row + max(x, 1))],
                grays[np.uintp(inner_row + min(x + 1, columns - 1))],
                times[np.uintp(cell - 1)] != _UNKNOWN,
                times[np.uintp(cell + 1)] != _UNKNOWN,
            )
            # Component of the gradient perpendicular to the line between the cells, times its
            # length.
            change = abs(np.float32(y - row) * along - np.float32(x - column) * across)
            weight = _WEIGHT_OF_FLAT
            if change > _FLAT:
                size = across * across + along * along
                weight = change / np.sqrt(np.float32(square) * size)
            weight *= _ONE / (np.float32(square * square) + _ONE)
            total += weight * grays[np.uintp(cell)]
            weights += weight
    return np.float32(np.float64(total) / np.float64(weights))


def _arrival(times: Any, one: Any, other: Any) -> Any:
    """Return the arrival time of the marching front, given a vertical and a horizontal neighbor."""
    first, second = np.float64(times[one]), np.float64(times[other])
    difference = first - second
    if abs(difference) < 1.0:
        return np.float32((first + second + math.sqrt(2.0 - difference * difference)) * 0.5)
    return np.float32(1.0 + min(first, second))


def _has_unknown_neighbor(times: Any, cell: Any, width: Any) -> Any:
    # The sum is infinite if any of the four times is infinite.
    return times[cell - width] + times[cell + width] + times[cell - 1] + times[cell + 1] == _UNKNOWN


def _fill_around(images: Any, frame: Any, middle: Any, queue: Any, number: Any) -> Any:
    """Fill and enqueue the unknown neighbors of a cell; return the next free queue number."""
    grays, times = images
    width = frame[1] + 2
    for cell in (middle - width, middle - 1, middle + width, middle + 1):
        if times[cell] == _UNKNOWN:
            above, left, below, right = cell - width, cell - 1, cell + width, cell + 1
            time = min(
                min(_arrival(times, above, left), _arrival(times, below, left)),
                min(_arrival(times, above, right), _arrival(times, below, right)),
            )
            grays[cell] = _estimate(images, frame, cell // width - 1, cell % width - 1)
            times[cell] = time
            if _has_unknown_neighbor(times, cell, width):
                heappush(queue, (time, number, cell))
                number += 1
    return number


@loop(("float32*", 2), ("int64", 3))
def _inpaint(images: Any, frame: Any) -> None:
    """Fill the unknown cells of `images`, a pair of gray values and arrival times.

    `frame` contains the numbers of rows and columns without padding, and the radius [cells].
    """
    times = images[1]
    rows, columns, _ = frame
    # A heap; cells with equal times are ordered by number.
    queue, number = [(_ZERO, 0, 0) for _ in range(0)], 0
    # The queue starts with the cells around holes, row by row.
    for row in range(1, rows + 1):
        for cell in range(row * (columns + 2) + 1, row * (columns + 2) + 1 + columns):
            if times[cell] == _ZERO and _has_unknown_neighbor(times, cell, columns + 2):
                number = _fill_around(images, frame, cell, queue, number)
    while len(queue) > 0:
        number = _fill_around(images, frame, heappop(queue)[2], queue, number)
