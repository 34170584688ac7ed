# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/ColorBlendingFilter`"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.config import check

from ..colors import Bits, Floats, color_cells, pack, to_bytes, unpack

Channels = tuple[Floats, Floats, Floats]


@dataclass(frozen=True, kw_only=True)
class ColorBlending:
    """Blend a layer of colours over another.

    Where one of both has no colour, the other one is taken.

    Attributes:
        blend_mode: "normal" mixes both; "hard_light" multiplies with dark colours of the foreground
            and screens with bright ones; "soft_light" is Pegtop's formula.
        opacity: of what the mode gives over the background, in [0, 1].
    """

    background_layer: str
    foreground_layer: str
    blend_mode: Literal["normal", "hard_light", "soft_light"] = "normal"
    opacity: float
    output_layer: str

    def __post_init__(self) -> None:
        check(0 <= self.opacity <= 1, "opacity", "a number in [0, 1]", self.opacity)

    def __call__(self, grid_map: GridMap) -> GridMap:
        layers = grid_map[self.background_layer], grid_map[self.foreground_layer]
        return grid_map.with_layers({self.output_layer: color_cells(self._blend, *layers)})

    def _blend(self, background: Floats, foreground: Floats) -> Bits:
        opacity, rest = np.float32(self.opacity), np.float32(1.0 - self.opacity)
        leaves_range = self.blend_mode == "hard_light"
        mixed = []
        below, above = unpack(background), unpack(foreground)
        for under, over in zip(below, _MODES[self.blend_mode](below, above), strict=True):
            channel = under * rest
            channel += over * opacity
            channel *= np.float32(255)
            mixed.append(to_bytes(channel) if leaves_range else channel.astype(np.uint8))
        bits = pack(mixed)
        for layer, other in ((foreground, background), (background, foreground)):
            # Three times as fast as what NumPy has for it.
            cv2.copyTo(other.view(np.int32), np.isnan(layer).view(np.uint8), bits.view(np.int32))
        return bits


def _normal(_: Channels, above: Channels) -> Channels:
    return above


def _hard_light(below: Channels, above: Channels) -> Iterator[Floats]:
    dark = (above[0] + above[1] + above[2] < np.float32(1.5)).view(np.uint8)
    for b, a in zip(below, above, strict=True):
        screened = 1 - 2 * (1 - b) * (1 - a)
        yield np.asarray(cv2.copyTo(2 * b * a, dark, screened), dtype=np.float32).reshape(-1)


def _soft_light(below: Channels, above: Channels) -> Iterator[Floats]:
    for b, a in zip(below, above, strict=True):
        yield (1 - 2 * a) * (b * b) + 2 * b * a


_MODES: dict[str, Callable[[Channels, Channels], Iterable[Floats]]] = {
    "normal": _normal,
    "hard_light": _hard_light,
    "soft_light": _soft_light,
}
