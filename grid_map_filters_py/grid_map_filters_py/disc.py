# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Sums over the disc around every cell at once, by correlation.

The disc is closed: a cell centre within 1e-9 m of the rim is inside. Beyond the border of the map
there is no data.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py.arrays import Layer, Mask, Size
from grid_map_core_py.geometry import BORDER_TOLERANCE

Kernel = npt.NDArray[np.float64]
Sums = npt.NDArray[np.float64]

# OpenCV correlates larger kernels through a Fourier transform, where one huge value spoils the
# sums of cells far away from it.
_LARGEST_DIRECT_KERNEL = 7


@dataclass(frozen=True)
class Disc:
    """The cells within `radius` of a cell.

    Args:
        radius: [m].
        resolution: side of a cell [m].
        size: rows and columns of the map; the disc has no cells further apart than the map's.
    """

    radius: float
    resolution: float
    size: Size

    @property
    def offsets(self) -> tuple[Kernel, Kernel]:
        """(n, 1) and (1, m) distances of rows and columns from the centre, in cells."""
        reach = (self.radius + BORDER_TOLERANCE) / self.resolution
        rows, columns = (_steps(min(reach, count - 1)) for count in self.size)
        return rows[:, None], columns[None, :]

    @property
    def kernel(self) -> Kernel:
        """(n, m) with 1 in the cells of the disc and 0 elsewhere; n and m are odd."""
        rows, columns = self.offsets
        limit = (self.radius + BORDER_TOLERANCE) / self.resolution
        return (np.hypot(rows, columns) <= limit).astype(np.float64)


def _steps(reach: float) -> Kernel:
    return np.arange(-int(reach), int(reach) + 1, dtype=np.float64)


def centred(layer: Layer) -> tuple[Mask, Sums, float]:
    """Return what sums over finite values need.

    Returns:
        mask: (rows, cols) where the layer is finite.
        values: (rows, cols) float64, the layer minus `offset`, and 0 where it is not finite.
        offset: about the median of the finite values; sums of small differences keep their
            precision on a layer that lies 1000 m up, whatever outliers it has.
    """
    mask = np.isfinite(layer)
    known = layer[mask]
    offset = float(np.median(known[:: known.size // 1000 + 1])) if known.size else 0.0
    values = np.where(mask, np.subtract(layer, offset, dtype=np.float64), 0.0)
    return mask, values, offset


def correlate(image: npt.NDArray[np.float64], kernel: Kernel) -> Sums:
    """Return for every cell the sum of its neighbours times the kernel centred on it.

    Args:
        image: (rows, cols) in Fortran order, without NaN; zero beyond the border.
        kernel: (n, m), both odd, rows and columns as in the image.

    Returns:
        (rows, cols) float64 in Fortran order.
    """
    transposed, kernel = image.T, np.ascontiguousarray(kernel.T)
    if max(kernel.shape) <= _LARGEST_DIRECT_KERNEL:
        return _filter(transposed, kernel).T
    padded = np.pad(transposed, [(side // 2, side // 2) for side in kernel.shape])
    rows, columns = transposed.shape
    total = np.zeros((rows, columns))
    for (row, column), part in _parts(kernel):
        height, width = part.shape
        region = padded[row : row + rows + height - 1, column : column + columns + width - 1]
        total += _filter(region, part, anchor=(0, 0))[:rows, :columns]
    return total.T


def _filter(image: Sums, kernel: Kernel, anchor: tuple[int, int] = (-1, -1)) -> Sums:
    result = cv2.filter2D(image, cv2.CV_64F, kernel, anchor=anchor, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(result, dtype=np.float64)


def _parts(kernel: Kernel) -> Iterator[tuple[tuple[int, int], Kernel]]:
    """Yield small pieces of a kernel with their first row and column; not those of zeros."""
    step = _LARGEST_DIRECT_KERNEL
    for row, column in product(*(range(0, side, step) for side in kernel.shape)):
        part = kernel[row : row + step, column : column + step]
        if part.any():
            yield (row, column), np.ascontiguousarray(part)
