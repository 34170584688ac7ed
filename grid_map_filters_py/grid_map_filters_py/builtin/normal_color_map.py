# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/NormalColorMapFilter`"""

from dataclasses import dataclass

import cv2
import numpy as np

from grid_map_core_py import GridMap

from ..colors import Bits, Floats, color_cells

_NAN_BITS = float(np.float32(np.nan).view(np.uint32))


@dataclass(frozen=True, kw_only=True)
class NormalColorMap:
    """Colour a map by its normals: red, green, blue are x, y, z taken from [-1, 1] to [0, 1].

    The colours of cells without a normal are NaN.
    """

    input_layers_prefix: str
    output_layer: str

    def __call__(self, grid_map: GridMap) -> GridMap:
        normals = (grid_map[self.input_layers_prefix + axis] for axis in "xyz")
        return grid_map.with_layers({self.output_layer: color_cells(_colors, *normals)})


def _colors(x: Floats, y: Floats, z: Floats) -> Bits:
    """Return the bits of colours; whole numbers below 2^24 are exact in single precision."""
    values = _bytes(x)
    for normal in (y, z):
        values *= np.float32(256)
        values += _bytes(normal)
    # Several times as fast as to find NaN and to set bits there.
    cv2.patchNaNs(values[None, :], _NAN_BITS)
    return values.astype(np.uint32)


def _bytes(normal: Floats) -> Floats:
    """Return whole numbers in [0, 255], NaN where there is no normal."""
    # The same bits as 255 * (0.5 * normal + 0.5), in a pass less.
    channel: Floats = normal + np.float32(1.0)
    channel *= np.float32(127.5)
    np.clip(channel, np.float32(0.0), np.float32(255.0), out=channel)
    np.trunc(channel, out=channel)
    return channel
