# SPDX-License-Identifier: BSD-3-Clause
"""Packed colors: layer values whose float32 bits are 0x00RRGGBB."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import as_numbers
from .._arrays._pieces import elementwise
from ..errors import GeometryError

Bytes: TypeAlias = NDArray[np.uint8]

NO_COLOR = np.float32(np.nan).view(np.uint32)
"""Bits of the NaN that marks cells without a color."""

_RED, _GREEN = np.uint32(16), np.uint32(8)


def color_vector_to_value(rgb: ArrayLike) -> NDArray[np.float32]:
    """Pack colors into layer values, whose float32 bits are 0x00RRGGBB.

    Args:
        rgb: (..., 3) red, green, blue; floats in [0, 1] or integers in [0, 255]. Values outside the
            range are clamped. Floats are rounded down to multiples of 1/255.

    Returns:
        (...) float32; NaN where a component is NaN.

    Raises:
        GeometryError: the last axis does not have length 3.
    """
    components = as_numbers(rgb, "rgb")
    if components.ndim == 0 or components.shape[-1] != 3:
        raise GeometryError(f"rgb: expected shape (..., 3), got {components.shape}")
    return color_channels_to_value(components[..., 0], components[..., 1], components[..., 2])


def color_channels_to_value(
    red: NDArray[Any], green: NDArray[Any], blue: NDArray[Any]
) -> NDArray[np.float32]:
    """Pack red, green and blue (...) into layer values (...)."""
    with np.errstate(invalid="ignore"):
        bits = elementwise(_pack, np.uint32, red, green, blue)
    return bits.view(np.float32)


def join_channels(red: Any, green: Any, blue: Any) -> Any:
    return red << _RED | green << _GREEN | blue


def split_channels(bits: Any) -> tuple[Any, Any, Any]:
    """Shift bits 0x00RRGGBB so that the lowest bytes are red, green and blue."""
    return bits >> _RED, bits >> _GREEN, bits


def color_value_to_vector(value: ArrayLike) -> NDArray[np.float32]:
    """Unpack layer values into colors.

    Args:
        value: (...) packed colors, as float32 layer values or as integers 0xRRGGBB. NaN means no
            color.

    Returns:
        (..., 3) float32 red, green, blue in [0, 1]; NaN where `value` is NaN.
    """
    values = as_numbers(value, "value")
    rgb = np.empty((*values.shape, 3), np.float32)
    for channel, component in enumerate(color_value_to_bytes(values)):
        rgb[..., channel] = component
    rgb /= np.float32(255)
    if values.dtype.kind == "f":
        rgb[np.isnan(values)] = np.nan
    return rgb


def color_value_to_bytes(value: NDArray[Any]) -> tuple[Bytes, Bytes, Bytes]:
    """Unpack layer values into red, green and blue; undefined where `value` is NaN."""
    if value.dtype.kind == "f":
        bits = value.astype(np.float32, copy=False).view(np.uint32)
    else:
        bits = value.astype(np.uint32, copy=False)
    red, green, blue = (channel.astype(np.uint8) for channel in split_channels(bits))
    return red, green, blue


def _pack(*channels: NDArray[Any]) -> NDArray[np.uint32]:
    """Pack channels, floats in [0, 1] or integers in [0, 255], into bits 0x00RRGGBB."""
    bits: NDArray[np.uint32] = join_channels(*map(_byte, channels))
    for channel in channels:
        if channel.dtype.kind == "f":
            bits[np.isnan(channel)] = NO_COLOR
    return bits


def _byte(channel: NDArray[Any]) -> NDArray[np.uint32]:
    if channel.dtype != np.uint8:
        # Some integer types cannot represent 255.
        scaled = 255 * channel if channel.dtype.kind == "f" else channel.astype(np.float64)
        channel = np.clip(scaled, 0, 255)
    return channel.astype(np.uint32)
