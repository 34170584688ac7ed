# SPDX-License-Identifier: BSD-3-Clause
"""The inpainting of `cv2.inpaint`, compiled: several times as fast where there are many holes.

Bertalmio, Bertozzi and Sapiro, "Navier-Stokes, Fluid Dynamics, and Image and Video Inpainting"
(2001), as OpenCV approximates it: holes are filled from their rim inwards, in the order of fast
marching (Sethian 1996). A cell becomes a weighted mean of the known and filled cells around it.
Weights fall with the distance, and grow where the image changes across the line to the cell.

Images have a frame of one cell.
"""

import math
from heapq import heappop, heappush
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Mask
from grid_map_core_py._loops import loop

_ZERO, _ONE, _UNKNOWN = np.float32(0), np.float32(1), np.float32(np.inf)
_OUTSIDE = np.float32(1e6)  # arrival time of cells outside of the image
# OpenCV's, for gray values from 0 to 255: the change up to which a direction counts as flat, the
# weight of such a direction, and what the sum of weights exceeds.
_FLAT, _WEIGHT_OF_FLAT, _LEAST_WEIGHT = np.float32(0.01), np.float32(1e-6), np.float32(1e-20)


def inpainted(
    image: npt.NDArray[np.float32], missing: Mask, radius: float
) -> npt.NDArray[np.float32] | None:
    """Return what `cv2.inpaint` returns for `cv2.INPAINT_NS`, or None without numba.

    Args:
        image: gray values (rows, columns), each side at least 3.
        missing: mask of the cells to fill.
        radius: radius of the neighborhood [cells], from 1 to 100.
    """
    run = _inpaint.compiled()
    if run is None:
        return None
    grays = np.pad(image, 1)
    times = np.pad(np.where(missing, _UNKNOWN, _ZERO), 1, constant_values=_OUTSIDE)
    run((grays, times), (*image.shape, min(round(radius), sum(image.shape))))
    return grays[1:-1, 1:-1]


def _change(before: Any, here: Any, after: Any, has_before: Any, has_after: Any) -> Any:
    """Return how much gray values change from cell to cell, in both directions together."""
    change = (abs(after - here) if has_after else _ZERO) + (
        abs(here - before) if has_before else _ZERO
    )
    return change if has_before and has_after else change + change


def _estimate(images: Any, frame: Any, row: Any, column: Any) -> Any:
    """Return the gray value of a cell from the known cells of the disc around it."""
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
            # Numba looks for negative indices, which takes long, unless they are unsigned.
            # At borders OpenCV takes the changes one cell further inside.
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
            # The gradient turned by a right angle, along which gray values continue.
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
    """Return the time at which a front arrives from two neighbors of a cell, at right angles."""
    first, second = np.float64(times[one]), np.float64(times[other])
    difference = first - second
    if abs(difference) < 1.0:
        return np.float32((first + second + math.sqrt(2.0 - difference * difference)) * 0.5)
    return np.float32(1.0 + min(first, second))


def _has_unknown_neighbor(times: Any, cell: Any, width: Any) -> Any:
    # The sum of all four is infinity if one of them is.
    return times[cell - width] + times[cell + width] + times[cell - 1] + times[cell + 1] == _UNKNOWN


def _fill_around(images: Any, frame: Any, middle: Any, queue: Any, number: Any) -> Any:
    """Fill the neighbors of a cell, add them to the queue, and return the next number in it."""
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
    """Fill the unknown cells of two images, gray values and arrival times.

    `frame` has the rows and columns within the frame, and the radius of the neighborhood.
    """
    times = images[1]
    rows, columns, _ = frame
    # A heap; cells of equal time have the order of their numbers.
    queue, number = [(_ZERO, 0, 0) for _ in range(0)], 0
    # The cells around holes come first, row after row.
    for row in range(1, rows + 1):
        for cell in range(row * (columns + 2) + 1, row * (columns + 2) + 1 + columns):
            if times[cell] == _ZERO and _has_unknown_neighbor(times, cell, columns + 2):
                number = _fill_around(images, frame, cell, queue, number)
    while len(queue) > 0:
        number = _fill_around(images, frame, heappop(queue)[2], queue, number)
