# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Colours of a cell, for filters that compute colours.

`grid_map_core_py.conversions` packs whatever a user has; here are the pieces of functions of cells.
"""

import numpy as np

from grid_map_core_py.plugins import check

from ..parts._cell_function import Value, choose, clamp, helper

FULL = np.float32(255)
"""Brightness of a channel whose share is 1."""

_NONE = np.float32(0)
_NAN = np.uint32(0x7FC00000)
_INFINITY, _MAGNITUDE = np.uint32(0x7F800000), np.uint32(0x7FFFFFFF)
_RED, _GREEN, _CHANNEL = np.uint32(16), np.uint32(8), np.uint32(255)


def check_color(name: str, color: tuple[float, ...]) -> None:
    """Check a parameter that is a colour."""
    finite = len(color) == 3 and bool(np.isfinite(color).all())
    check(finite, name, "three finite numbers: red, green, blue", list(color))


@helper
def pack(r: Value, g: Value, b: Value) -> Value:
    """Return the bits 0x00RRGGBB of a colour.

    Args:
        r, g, b: red, green and blue, float32. Values beyond [0, 255] are clamped, fractions are
            cut off.
    """
    return _byte(r) << _RED | _byte(g) << _GREEN | _byte(b)


@helper
def _byte(channel: Value) -> Value:
    """Return a channel as an integer."""
    return np.uint32(np.int32(clamp(channel, _NONE, FULL)))


@helper
def or_none(color: Value, exists: Value) -> Value:
    """Return the bits of a colour where there is one, else those of NaN."""
    return choose(exists, color, _NAN)


@helper
def is_none(color: Value) -> Value:
    """Tell whether the bits of a colour are those of a NaN."""
    return color & _MAGNITUDE > _INFINITY


@helper
def red(color: Value) -> Value:
    """Return the share of red in a colour's bits, from 0 to 1."""
    return _lowest(color >> _RED)


@helper
def green(color: Value) -> Value:
    """Return the share of green in a colour's bits, from 0 to 1."""
    return _lowest(color >> _GREEN)


@helper
def blue(color: Value) -> Value:
    """Return the share of blue in a colour's bits, from 0 to 1."""
    return _lowest(color)


@helper
def _lowest(color: Value) -> Value:
    """Return what the lowest byte of a colour's bits stands for."""
    # Signed integers have faster conversions.
    return np.float32(np.int32(color & _CHANNEL)) / FULL
