# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the web viewer: layers, colors, vectors and scale."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from ..colors import Coloring

AXES = "xyz"

NONE = ""
"""In place of a layer or prefix: there is none."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What to show of a map, and how.

    Attributes:
        height_layer: heights [m] of the surface.
        flat: draw everything at height zero.
        coloring: where the colors come from.
        shaded: let a light fall on the surface; without, colors are exactly those of the legend.
        opacity: of the surface; 1 hides what is behind.
        grid_lines: draw lines between neighboring cells.
        points: draw a point at every cell.
        vectors: followed by x, y or z it is the name of the layer of that component of the vectors
            to draw; empty for none.
        vector_scale: length of a line per length of its vector [m].
        history: so many maps are shown, older ones under newer ones.
    """

    height_layer: str
    flat: bool = False
    coloring: Coloring = field(default_factory=Coloring)
    shaded: bool = True
    opacity: float = 1.0
    grid_lines: bool = False
    points: bool = False
    vectors: str = NONE
    vector_scale: float = 0.1
    history: int = 1

    @property
    def layers(self) -> set[str]:
        """The layers that are needed."""
        needed = {self.height_layer}
        if self.coloring.mode != "flat" and self.coloring.layer:
            needed.add(self.coloring.layer)
        if self.vectors:
            needed.update(self.vectors + axis for axis in AXES)
        return needed


def follow(chosen: str, layers: Sequence[str], preferred: Sequence[str] = ()) -> str:
    """Return which layer to show: the chosen one while it exists, else a preferred or the first.

    Raises:
        IndexError: there are no layers.
    """
    return next((name for name in (chosen, *preferred) if name in layers), layers[0])


def vector_prefixes(layers: Sequence[str]) -> list[str]:
    """Return the prefixes that three layers share which end in x, y and z."""
    ending_in_x = (name.removesuffix("x") for name in layers if name.endswith("x"))
    # Layers that are called x, y and z have none, and are more likely positions.
    return [name for name in ending_in_x if name and all(name + axis in layers for axis in AXES)]
