# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Conversion between sRGB colors, linear light and tone-mapped colors on a screen."""

import numpy as np
import numpy.typing as npt

from ..colors import Colors

Light = npt.NDArray[np.float64]
"""(..., 3) red, green, blue, linear, 1 for white."""

EXPOSURE = 1 / 0.6

TO_FILM = np.array(
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
)
FROM_FILM = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)


def linear(colors: Colors) -> Light:
    """Return the linear light of sRGB colors (IEC 61966-2-1)."""
    value = np.arange(256) / 255
    table = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return np.take(table, colors)


def on_screen(colors: Colors) -> Colors:
    """Return the screen colors of a surface of these colors in full light.

    viser uses filmic tone mapping, in which strong light saturates. The curve is Stephen Hill's fit
    of the Academy Color Encoding System, `ACESFilmicToneMapping` in three.js.
    """
    film = EXPOSURE * linear(colors) @ TO_FILM.T
    film = (film * (film + 0.0245786) - 0.000090537) / (
        film * (0.983729 * film + 0.4329510) + 0.238081
    )
    light = np.clip(film @ FROM_FILM.T, 0, 1)
    bent = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    shown: Colors = np.rint(255 * bent).astype(np.uint8)
    return shown
