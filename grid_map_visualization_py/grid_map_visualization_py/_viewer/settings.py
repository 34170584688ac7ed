# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the page: layers to show and their style."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from ..colors import Coloring

AXES = "xyz"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Layers to show and their style.

    Attributes:
        height_layer: heights [m] of the surface.
        flat: draw everything at height zero.
        coloring: source of the colors.
        shaded: light the surface; otherwise its colors are exactly those of the legend.
        opacity: from 0 (invisible) to 1 (opaque).
        grid_lines: draw lines between neighboring cells.
        points: draw a point at every cell.
        vectors: prefix of three layers that end in x, y and z, drawn as vectors; empty for none.
        vector_scale: length of the line of a vector of length 1 [m].
        history: number of maps that stay in the scene.
    """

    height_layer: str
    flat: bool = False
    coloring: Coloring = field(default_factory=Coloring)
    shaded: bool = True
    opacity: float = 1.0
    grid_lines: bool = False
    points: bool = False
    vectors: str = ""
    vector_scale: float = 0.1
    history: int = 1

    @property
    def layers(self) -> set[str]:
        """Layers that these settings need."""
        needed = {self.height_layer}
        if self.coloring.mode != "flat" and self.coloring.layer:
            needed.add(self.coloring.layer)
        if self.vectors:
            needed.update(self.vectors + axis for axis in AXES)
        return needed


def follow(chosen: str, layers: Sequence[str], preferred: Sequence[str] = ()) -> str:
    """Return the chosen layer if it exists, else the first preferred one, else the first of all.

    Raises:
        IndexError: there are no layers.
    """
    return next((name for name in (chosen, *preferred) if name in layers), layers[0])


def vector_prefixes(layers: Sequence[str]) -> list[str]:
    """Return the common prefixes of three layers that end in x, y and z."""
    ending_in_x = (name.removesuffix("x") for name in layers if name.endswith("x"))
    # Layers called x, y and z are more likely positions than vector components.
    return [name for name in ending_in_x if name and all(name + axis in layers for axis in AXES)]
