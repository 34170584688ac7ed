# SPDX-License-Identifier: BSD-3-Clause
"""Planar cells: those whose window is close to its least-squares plane.

Images in this module are transposed layers (cols, rows) in C order.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Mask
from ._parameters import PlaneParameters

Image = NDArray[Any]
Numbers = NDArray[np.float64]

CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
_BOX = np.ones((3, 3), np.uint8)
_SIMILAR = 2  # neighbors at the height of a cell that make it a corner instead of an outlier


class Cells(NamedTuple):
    """Planar cells as arrays (..., N), with positions relative to cell (0, 0) [m].

    Attributes:
        places: (N,) indices into the flat image.
        points: (3, N) positions x, y, z; heights of outliers are filtered.
        slopes: (2, N) dz/dx and dz/dy of the plane of the window.
        is_exact: (N,) cells that are no outliers; only these are fitted.
    """

    places: NDArray[np.int64]
    points: Numbers
    slopes: Numbers
    is_exact: Mask

    def take(self, chosen: NDArray[Any]) -> Cells:
        """Return the cells at indices (M,)."""
        parts: Any = self
        return Cells(*(values.take(chosen, axis=-1) for values in parts))


def planar_cells(
    heights: Image, resolution: float, parameters: PlaneParameters
) -> tuple[Cells, Mask]:
    """Return the planar cells of an image of heights [m], and the image of their mask."""
    limits, median = parameters.sliding_window_plane_extractor, parameters.preprocessing
    reach = limits.kernel_size // 2
    border = 2 + max(reach, median.kernelSize // 2)
    inner = (slice(border, -border),) * 2
    unknown = np.float32(np.nan)
    known = np.isfinite(heights)
    raw = np.pad(np.where(known, heights, unknown), border, constant_values=unknown)
    smooth = raw.copy()
    for _ in range(median.numberOfRepeats):
        filtered = cv2.medianBlur(_continued(smooth, median.kernelSize // 2), median.kernelSize)
        smooth = np.where(np.isnan(raw), unknown, filtered)
    outliers = _outliers(raw, smooth, limits.global_plane_fit_distance_error_threshold)[inner]
    slopes, squares = _window_fits(_continued(smooth, reach), reach, resolution)
    slopes = slopes[:, inner[0], inner[1]]
    squares, smooth = squares[inner], smooth[inner]
    steepest = math.tan(math.radians(limits.local_plane_inclination_threshold_degrees))
    with np.errstate(invalid="ignore"):  # windows far from any cell are NaN
        planar = known & (slopes[0] ** 2 + slopes[1] ** 2 <= steepest**2)
        planar &= squares <= limits.plane_patch_error_threshold**2
    # An outlier stays in a region only if the region surrounds it.
    planar &= ~outliers | cv2.erode(planar.view(np.uint8), _BOX).view(np.bool_)
    if limits.planarity_opening_filter:
        steps: Any = {"kernel": CROSS, "iterations": limits.planarity_opening_filter}
        planar = cv2.morphologyEx(planar.view(np.uint8), cv2.MORPH_OPEN, **steps).view(np.bool_)
    places = np.flatnonzero(planar)
    columns, rows = np.divmod(places, heights.shape[1])
    points = np.empty((3, places.size))
    points[0], points[1] = -resolution * rows, -resolution * columns
    points[2] = np.where(outliers, smooth, heights)[planar]
    return Cells(places, points, slopes[:, planar], ~outliers[planar]), planar


def _outliers(raw: Image, smooth: Image, threshold: float) -> Mask:
    """Return the cells that the median filter moved by more than the threshold [m].

    The filter also cuts off corners. A lowered cell with at least two neighbors as high as its raw
    height is a corner, and gets its raw height back. Corners of pits stay filled.
    """
    with np.errstate(over="ignore"):
        outliers: Mask = np.abs(raw - smooth) > threshold
    places = np.flatnonzero(outliers & (raw > smooth))
    heights = raw.reshape(-1)
    near = heights[places[:, None] + _neighbors(raw)]
    is_similar = np.abs(near - heights[places, None]) <= threshold
    corners = places[is_similar.sum(axis=1) >= _SIMILAR]
    smooth.reshape(-1)[corners] = heights[corners]
    outliers.reshape(-1)[corners] = False
    return outliers


def _neighbors(image: Image) -> NDArray[np.int64]:
    """Return the steps to the neighbors of a cell in a flat image: four sides, four diagonals."""
    width = image.shape[1]
    return np.array([-width, -1, 1, width, -width - 1, -width + 1, width - 1, width + 1])


def _continued(heights: Image, rounds: int) -> Image:
    """Continue heights linearly into the unknown cells (NaN) next to known cells.

    Each round fills one ring of cells. In each direction, the next two cells define a line; a cell
    gets the mean over the four sides, else over the diagonals, else the mean of its neighbors.
    The border of the image must be unknown, two cells wider than `rounds`.
    """
    heights = heights.copy()
    flat, steps = heights.reshape(-1), _neighbors(heights)
    for _ in range(rounds):
        known = ~np.isnan(heights)
        ring = np.flatnonzero(cv2.dilate(known.view(np.uint8), _BOX).view(np.bool_) & ~known)
        near, far = flat[ring[:, None] + steps], flat[ring[:, None] + 2 * steps]
        lines = 2 * near - far
        for guesses in (near, lines[:, 4:], lines[:, :4]):
            counts = np.count_nonzero(~np.isnan(guesses), axis=1)
            chosen = np.flatnonzero(counts)
            flat[ring[chosen]] = np.nansum(guesses[chosen], axis=1) / counts[chosen]
    return heights


def _window_fits(heights: Image, reach: int, resolution: float) -> tuple[Image, Image]:
    """Return dz/dx and dz/dy (2, cols, rows) and mean squared deviations [m^2] of all windows.

    On a symmetric window, the coordinates and the constant are orthogonal, so each coefficient of
    the least-squares plane is a single sum.
    """
    data = heights.astype(np.float64)
    size = 2 * reach + 1
    mean = np.full(size, 1 / size)
    steps = resolution * np.arange(reach, -reach - 1.0, -1.0)  # rows and columns run to -x and -y
    spread = (steps**2).mean()

    def filtered(image: Image, along_x: Numbers, along_y: Numbers) -> Image:
        border = cv2.BORDER_REPLICATE
        return cv2.sepFilter2D(image, cv2.CV_64F, along_x, along_y, borderType=border)

    gradient = steps / (size * spread)
    slopes = np.stack([filtered(data, gradient, mean), filtered(data, mean, gradient)])
    squares = filtered(data**2, mean, mean) - filtered(data, mean, mean) ** 2
    return slopes, squares - spread * (slopes[0] ** 2 + slopes[1] ** 2)
