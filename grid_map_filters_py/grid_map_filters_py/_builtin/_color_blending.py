# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/ColorBlendingFilter`"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check

from .._filter import CellFilter
from ..parts._cell_function import Value, cell_function, choose
from ..parts._colors import FULL, is_none, pack, shares

_ONE, _TWO, _DARK = np.float32(1), np.float32(2), np.float32(1.5)


@dataclass(frozen=True, kw_only=True)
class ColorBlending(CellFilter):
    """Blend a foreground color layer over a background color layer.

    If only one of the two layers has a color in a cell, the result is that color.

    Attributes:
        background_layer: layer with the background colors.
        foreground_layer: layer with the foreground colors.
        blend_mode: "normal" shows the foreground. "hard_light" darkens the background where the
            foreground is dark, and brightens it elsewhere. "soft_light" has a weaker effect.
        opacity: weight of the blended color relative to the background, from 0 to 1.
        output_layer: layer for the result.
    """

    background_layer: str
    foreground_layer: str
    blend_mode: Literal["normal", "hard_light", "soft_light"] = "normal"
    opacity: float
    output_layer: str

    def __post_init__(self) -> None:
        check(0 <= self.opacity <= 1, "opacity", "a number in [0, 1]", self.opacity)
        _MODES[self.blend_mode].prepare()

    def __call__(self, grid_map: GridMap) -> GridMap:
        layers = [grid_map[self.background_layer], grid_map[self.foreground_layer]]
        blended = _MODES[self.blend_mode](layers, (self.opacity, 1 - self.opacity))
        return grid_map.with_layers({self.output_layer: blended})


@cell_function(takes=np.uint32, gives=np.uint32, numbers=2)
def _normal(below: Value, above: Value, weights: tuple[Value, ...]) -> Value:
    return _blended(below, above, shares(below), shares(above), weights)


@cell_function(takes=np.uint32, gives=np.uint32, numbers=2)
def _hard_light(below: Value, above: Value, weights: tuple[Value, ...]) -> Value:
    back, fore = shares(below), shares(above)
    is_dark = fore[0] + fore[1] + fore[2] < _DARK
    r = _hard(back[0], fore[0], is_dark)
    g = _hard(back[1], fore[1], is_dark)
    b = _hard(back[2], fore[2], is_dark)
    return _blended(below, above, back, (r, g, b), weights)


@cell_function(takes=np.uint32, gives=np.uint32, numbers=2)
def _soft_light(below: Value, above: Value, weights: tuple[Value, ...]) -> Value:
    back, fore = shares(below), shares(above)
    r, g, b = _soft(back[0], fore[0]), _soft(back[1], fore[1]), _soft(back[2], fore[2])
    return _blended(below, above, back, (r, g, b), weights)


def _hard(below: Value, above: Value, is_dark: Value) -> Value:
    screened = _ONE - _TWO * (_ONE - below) * (_ONE - above)
    return choose(is_dark, _TWO * below * above, screened)


def _soft(below: Value, above: Value) -> Value:
    return (_ONE - _TWO * above) * (below * below) + _TWO * below * above


def _blended(
    below: Value,
    above: Value,
    back: tuple[Value, ...],
    front: tuple[Value, ...],
    weights: tuple[Value, ...],
) -> Value:
    """Return the color of a cell; `front` contains the blended channels (0 to 1) at opacity 1."""
    r = FULL * (back[0] * weights[1] + front[0] * weights[0])
    g = FULL * (back[1] * weights[1] + front[1] * weights[0])
    b = FULL * (back[2] * weights[1] + front[2] * weights[0])
    blended = choose(is_none(above), below, pack(r, g, b))
    return choose(is_none(below), above, blended)


_MODES = {"normal": _normal, "hard_light": _hard_light, "soft_light": _soft_light}
