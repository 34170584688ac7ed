# SPDX-License-Identifier: BSD-3-Clause
"""Resamples layers, which may contain NaN, to another number of rows and columns."""

import math

import cv2
import numpy as np
import numpy.typing as npt

from .._arrays._checks import Layer, Size
from ..errors import GeometryError, short
from ._interpolation import Interpolation

_TIE = 1e-9  # tolerance [cells] for target cells halfway between two source cells
_ROUND_OFF = 1e-5  # largest rounding error of a sum of weights

_FLAGS = {
    "nearest": cv2.INTER_NEAREST,
    "linear": cv2.INTER_LINEAR,
    "cubic": cv2.INTER_CUBIC,
    "area": cv2.INTER_AREA,
    "lanczos": cv2.INTER_LANCZOS4,
}


def resize_flag(interpolation: Interpolation | str | int) -> int:
    """Return OpenCV's `resize` flag for a name, an `Interpolation` or a flag."""
    if isinstance(interpolation, int):
        return interpolation
    name = interpolation.value if isinstance(interpolation, Interpolation) else interpolation
    if name not in _FLAGS:
        known = ", ".join(_FLAGS)
        raise GeometryError(f"interpolation: expected one of {known}, got {short(name)}")
    return _FLAGS[name]


def resample(layer: Layer, size: Size, factor: float, interpolation: int) -> Layer:
    """Interpolate a layer with OpenCV's `resize`; both grids begin at the same corner.

    If the nearest source cell is NaN or infinite, the target cell gets its value. Other target
    cells depend on finite source cells only. `factor` is the number of target cells per source cell
    along each axis.
    """
    if interpolation in (cv2.INTER_NEAREST, cv2.INTER_NEAREST_EXACT):
        return _resized(layer, size, factor, interpolation)
    finite = np.isfinite(layer)
    if finite.all():
        return _resized(layer, size, factor, interpolation)
    rows, columns = layer.shape
    picked = layer.T.take(_nearest(columns, size[1], factor), axis=0)
    nearest = picked.take(_nearest(rows, size[0], factor), axis=1).T
    values, known = np.where(finite, layer, np.float32(0)), finite.astype(np.float32)
    result = _resized(values, size, factor, interpolation)
    shares = _resized(known, size, factor, interpolation)
    # Near NaN cells, positive and negative weights may cancel. Use nonnegative weights there.
    positive = cv2.INTER_AREA if interpolation == cv2.INTER_AREA else cv2.INTER_LINEAR
    with np.errstate(divide="ignore", invalid="ignore"):
        means = _resized(values, size, factor, positive) / _resized(known, size, factor, positive)
    np.copyto(result, means, where=np.abs(shares - 1) > _ROUND_OFF)
    np.copyto(result, nearest, where=~np.isfinite(nearest))
    return result


def _nearest(sources: int, targets: int, factor: float) -> npt.NDArray[np.intp]:
    centers = (np.arange(targets) + 0.5) / factor
    # If a target cell is halfway between two source cells, the first one counts as the nearest.
    cells: npt.NDArray[np.intp] = np.ceil(centers - 1.0 - _TIE).clip(0, sources - 1).astype(np.intp)
    return cells


def _resized(layer: Layer, size: Size, factor: float, interpolation: int) -> Layer:
    # OpenCV may round the result size down (2.5 to 2); the margin keeps the last row or column.
    margins = [
        (0, math.ceil(1.0 / factor) if np.rint(sources * factor) < targets else 0)
        for sources, targets in zip(layer.shape, size, strict=True)
    ]
    image = np.ascontiguousarray(np.pad(layer, margins, mode="edge").T)
    try:
        resized = cv2.resize(image, None, fx=factor, fy=factor, interpolation=interpolation)
    except cv2.error as error:
        raise GeometryError(
            f"interpolation: OpenCV cannot resize with {interpolation!r}: {error.err}"
        ) from error
    return np.asfortranarray(np.reshape(resized, (-1, resized.shape[-1])).T[: size[0], : size[1]])
