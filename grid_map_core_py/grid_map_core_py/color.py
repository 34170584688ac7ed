# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Colours in layers: one float32 whose bits are 0x00RRGGBB."""

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
    if components.ndim == 0 or components.shape[-1] != 3:
        raise GeometryError(f"rgb: expected shape (..., 3), got {components.shape}")
    if components.dtype.kind == "f":
        return _pack(_as_bytes(components), np.isnan(components).any(axis=-1))
    return _pack(np.clip(components, 0, 255).astype(np.uint32), np.False_)


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


def _as_bytes(components: npt.NDArray[Any]) -> npt.NDArray[np.uint32]:
    scaled: npt.NDArray[np.floating[Any]] = 255 * np.clip(np.nan_to_num(components, nan=0.0), 0, 1)
    return scaled.astype(np.uint32)


def _pack(
    components: npt.NDArray[np.uint32], missing: npt.NDArray[np.bool_] | np.bool_
) -> npt.NDArray[np.float32]:
    red, green, blue = (components[..., channel] for channel in range(3))
    bits = np.asarray(red << 16 | green << 8 | blue, dtype=np.uint32)
    values = bits.view(np.float32)
    return np.where(missing, np.float32(np.nan), values)
