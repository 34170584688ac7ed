# SPDX-License-Identifier: BSD-3-Clause
"""Helpers for cell functions that compute colors, packed as 0x00RRGGBB into layer values."""

import numpy as np

from grid_map_core_py.conversions._packed_colors import NO_COLOR, join_channels, split_channels
from grid_map_core_py.plugins import check

from ._cell_function import Value, choose, clamp

FULL = np.float32(255)
"""Maximum value of a channel."""

_NONE = np.float32(0)
_INFINITY, _MAGNITUDE = np.uint32(0x7F800000), np.uint32(0x7FFFFFFF)
_CHANNEL = np.uint32(255)


def check_color(name: str, color: tuple[float, ...]) -> None:
    """Raise an error unless a parameter is a valid color."""
    finite = len(color) == 3 and bool(np.isfinite(color).all())
    check(finite, name, "three finite numbers: red, green, blue", list(color))


def pack(r: Value, g: Value, b: Value) -> Value:
    """Clamp float32 channels to [0, 255], truncate them, and pack them into 0x00RRGGBB."""
    return join_channels(_byte(r), _byte(g), _byte(b))


def _byte(channel: Value) -> Value:
    return np.uint32(np.int32(clamp(channel, _NONE, FULL)))


def or_none(color: Value, exists: Value) -> Value:
    """Return `color` where `exists` is true, and the bits of NaN elsewhere."""
    return choose(exists, color, NO_COLOR)


def is_none(color: Value) -> Value:
    """Return True where the bits of a color are NaN."""
    return color & _MAGNITUDE > _INFINITY


def shares(color: Value) -> tuple[Value, Value, Value]:
    """Unpack a color into red, green and blue, each in [0, 1]."""
    red, green, blue = split_channels(color)
    return _share(red), _share(green), _share(blue)


def _share(channel: Value) -> Value:
    """Return the lowest byte of a channel, scaled to [0, 1]."""
    # Signed integers convert to float faster.
    return np.float32(np.int32(channel & _CHANNEL)) / FULL
