# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Colours in layers: one float32 whose bits are 0x00RRGGBB."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import GeometryError


def color_vector_to_value(rgb: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Pack colours into layer values.

    Args:
        rgb: (..., 3) red, green, blue; floats in [0, 1], or integers in [0, 255]. Values beyond are
            clamped, fractions of 1/255 are cut off.

    Returns:
        (...) float32; NaN where a component is NaN.

    Raises:
        GeometryError: the last axis does not hold three components.
    """
    components = np.asarray(rgb)
    if components.dtype.kind not in "biuf":
        raise GeometryError(f"rgb: expected numbers, got {rgb!r}")
    if components.ndim == 0 or components.shape[-1] != 3:
        raise GeometryError(f"rgb: expected shape (..., 3), got {components.shape}")
    channels = np.moveaxis(components, -1, 0)
    if components.dtype.kind == "f":
        return color_channels_to_value(*channels)
    return _pack(np.clip(channel, 0, 255) for channel in channels)


def color_channels_to_value(
    red: npt.NDArray[Any], green: npt.NDArray[Any], blue: npt.NDArray[Any]
) -> npt.NDArray[np.float32]:
    """Pack colours, given as three arrays, into layer values.

    Args:
        red, green, blue: (...) floats in [0, 1], as in `color_vector_to_value`.

    Returns:
        (...) float32, in the memory order of the arrays; NaN where a component is NaN.
    """
    channels = (red, green, blue)
    missing = np.isnan(red) | np.isnan(green) | np.isnan(blue)
    with np.errstate(invalid="ignore"):
        values = _pack(np.clip(255 * channel, 0, 255) for channel in channels)
    return np.where(missing, np.float32(np.nan), values)


def _pack(channels: Iterable[npt.NDArray[Any]]) -> npt.NDArray[np.float32]:
    """Pack red, green and blue in [0, 255]; fractions are cut off."""
    red, green, blue = (channel.astype(np.uint32) for channel in channels)
    return np.asarray(red << 16 | green << 8 | blue, dtype=np.uint32).view(np.float32)


def color_value_to_vector(value: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Unpack layer values into colours.

    Args:
        value: (...) float32 colour values; NaN means no colour.

    Returns:
        (..., 3) float32 red, green, blue in [0, 1]; NaN where `value` is NaN.
    """
    values = np.asarray(value, dtype=np.float32)
    bits = values.view(np.uint32)[..., None] >> np.array([16, 8, 0], dtype=np.uint32)
    rgb = (bits & 0xFF).astype(np.float32) / np.float32(255)
    rgb[np.isnan(values)] = np.nan
    return rgb
