# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Colours of all cells at once, in as few passes over the data as possible.

For filters that compute colours; `grid_map_core_py.color` packs whatever a user has.
"""

from collections.abc import Callable, Iterable

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py.arrays import Layer
from grid_map_core_py.config import check
from grid_map_core_py.pieces import slices

Floats = npt.NDArray[np.float32]
Bits = npt.NDArray[np.uint32]
Bytes = npt.NDArray[np.uint8]

_PIECE = 2**15
"""Cells whose temporaries stay in the cache; smaller pieces would lose by their overhead."""


def check_color(name: str, color: tuple[float, ...]) -> None:
    """Check a parameter that is a colour."""
    finite = len(color) == 3 and bool(np.isfinite(color).all())
    check(finite, name, "three finite numbers: red, green, blue", list(color))


def color_cells(function: Callable[..., Bits], *layers: Layer) -> Layer:
    """Return the colour layer that a function computes from layers, piece by piece.

    Args:
        function: takes as many arrays (n,) as there are layers and returns bits 0x00RRGGBB. It may
            compute with NaN and infinities.
        layers: (rows, cols) in Fortran order.
    """
    flat = [layer.ravel("K") for layer in layers]
    bits = np.empty(flat[0].size, np.uint32)
    with np.errstate(invalid="ignore", over="ignore"):
        for piece in slices(bits.size, _PIECE):
            bits[piece] = function(*(values[piece] for values in flat))
    return bits.view(np.float32).reshape(layers[0].T.shape).T


def to_bytes(channel: Floats) -> Bytes:
    """Return a channel (n,) as bytes; values beyond [0, 255] are clamped, fractions are cut off."""
    clamped = np.clip(channel, np.float32(0), np.float32(255), out=channel)
    return clamped.astype(np.uint8)


def pack(channels: Iterable[Bytes], missing: Floats | None = None) -> Bits:
    """Return the bits of colours.

    Args:
        channels: red, green and blue (n,).
        missing: (n,) NaN where there is no colour, else 0; None if there is one everywhere.
    """
    red, green, blue = (channel[None, :] for channel in channels)
    planes = [blue, green, red, np.zeros_like(red)]
    bits: Bits = cv2.merge(planes).view(np.uint32).reshape(-1)
    if missing is not None:
        # As an integer 0 is less than any other colour, and NaN is more.
        np.maximum(bits, missing.view(np.uint32), out=bits)
    return bits


def unpack(colors: Floats) -> tuple[Floats, Floats, Floats]:
    """Return red, green and blue in [0, 1] of colours (n,); any numbers where they are NaN."""
    bits = colors.view(np.int32)
    red, green, blue = (_share(bits >> shift) for shift in (16, 8, 0))
    return red, green, blue


def _share(bits: npt.NDArray[np.int32]) -> Floats:
    bits &= 255
    share = bits.astype(np.float32)
    share /= np.float32(255)
    return share
