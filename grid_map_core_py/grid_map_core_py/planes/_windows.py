# SPDX-License-Identifier: BSD-3-Clause
"""Local planes: the least-squares plane of the window around every cell.

Arrays in this module are images: transposed layers (columns, rows) in C order. Slopes are
differences of height per cell, along the rows and along the columns of the map.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Layer, Mask
from ._parameters import PlaneParameters

Image = NDArray[Any]

_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
_BOX = np.ones((3, 3), np.uint8)
_SIMILAR = 2  # neighbors at the height of a cell that make it a corner instead of an outlier


class LocalPlanes(NamedTuple):
    """Local planes of all cells, as images.

    Attributes:
        known: cells with a finite height.
        heights: heights after the median filter [m].
        outliers: cells that the median filter moved farther than a cell may be from its plane.
        slopes: along rows and columns [m per cell].
        planar: cells whose window is flat enough and not too steep.
    """

    known: Mask
    heights: Image
    outliers: Mask
    slopes: tuple[Image, Image]
    planar: Mask


def local_planes(heights: Layer, resolution: float, parameters: PlaneParameters) -> LocalPlanes:
    """Fit a plane to the window around every cell of an image of heights [m]."""
    known = np.isfinite(heights)
    windows, filters = parameters.sliding_window_plane_extractor, parameters.preprocessing
    reach = windows.kernel_size // 2
    border = max(reach, filters.kernelSize // 2)
    raw = np.pad(np.where(known, heights, np.float32(np.nan)), border + 2, constant_values=np.nan)
    padded = raw.copy()
    inner = (slice(border + 2, -border - 2),) * 2
    for _ in range(filters.numberOfRepeats):
        smooth = cv2.medianBlur(_continued(padded, filters.kernelSize // 2), filters.kernelSize)
        padded[inner] = np.where(known, smooth[inner], np.float32(np.nan))
    outliers = _keep_corners(padded, raw, windows.global_plane_fit_distance_error_threshold)
    smooth = padded[inner].copy()
    *slopes, rms = (image[inner] for image in _window_sums(_continued(padded, reach), reach))
    steepest = math.tan(math.radians(windows.local_plane_inclination_threshold_degrees))
    with np.errstate(invalid="ignore"):  # windows far from any cell are NaN
        planar = slopes[0] ** 2 + slopes[1] ** 2 <= (steepest * resolution) ** 2
        planar &= rms <= windows.plane_patch_error_threshold**2
    planar &= known
    # An outlier stays in a region only if the region surrounds it.
    planar &= ~outliers[inner] | cv2.erode(planar.view(np.uint8), _BOX).view(np.bool_)
    if windows.planarity_opening_filter:
        steps: Any = {"kernel": _CROSS, "iterations": windows.planarity_opening_filter}
        opened = cv2.morphologyEx(planar.view(np.uint8), cv2.MORPH_OPEN, **steps)
        planar = opened.view(np.bool_)
    return LocalPlanes(known, smooth, outliers[inner], (slopes[0], slopes[1]), planar)


def _keep_corners(filtered: Image, raw: Image, threshold: float) -> Image:
    """Restore the raw heights at corners, which the median filter cuts off; return the outliers.

    A cell that moved by more than the threshold [m] is a corner if it was lowered and at least two
    neighbors are as high as its raw height, and an outlier otherwise. Corners of pits stay filled.
    """
    with np.errstate(over="ignore"):
        outliers = np.abs(raw - filtered) > threshold
    places = np.flatnonzero(outliers & (raw > filtered))
    heights = raw.reshape(-1)
    near = heights[places[:, None] + _neighbors(raw.shape[1])]
    is_corner = (np.abs(near - heights[places, None]) <= threshold).sum(axis=1) >= _SIMILAR
    corners = places[is_corner]
    filtered.reshape(-1)[corners] = heights[corners]
    outliers.reshape(-1)[corners] = False
    return np.asarray(outliers)


def _neighbors(width: int) -> NDArray[np.int64]:
    """Return the steps to the neighbors of a cell in a flat image: four sides, four diagonals."""
    return np.array([-width, -1, 1, width, -width - 1, -width + 1, width - 1, width + 1])


def _continued(heights: Image, rounds: int) -> Image:
    """Continue heights linearly into the unknown cells (NaN) next to known cells.

    Each round fills one ring of cells. In each direction, the next two cells define a line; a cell
    gets the mean over the four sides, else over the diagonals, else the mean of its neighbors.
    The border of the image must be unknown, two cells wider than `rounds`.
    """
    heights = heights.copy()
    flat, steps = heights.reshape(-1), _neighbors(heights.shape[1])
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


def _window_sums(heights: Image, reach: int) -> tuple[Image, Image, Image]:
    """Return the slopes along rows and columns [m per cell] and the mean squared deviation [m^2].

    On a symmetric window, the coordinates and the constant are orthogonal, so each coefficient of
    the least-squares plane is a single sum.
    """
    data = heights.astype(np.float64)
    size = 2 * reach + 1
    ones, along = np.ones(size), np.arange(-reach, reach + 1.0)
    spread = size * (along**2).sum()
    options: Any = {"borderType": cv2.BORDER_REPLICATE}
    rows = cv2.sepFilter2D(data, cv2.CV_64F, along / spread, ones, **options)
    columns = cv2.sepFilter2D(data, cv2.CV_64F, ones, along / spread, **options)
    means = cv2.sepFilter2D(data, cv2.CV_64F, ones / size, ones / size, **options)
    data *= data
    squares: Image = cv2.sepFilter2D(data, cv2.CV_64F, ones / size, ones / size, **options)
    squares -= means**2
    squares -= (rows**2 + columns**2) * (spread / size**2)
    return rows, columns, squares
