# SPDX-License-Identifier: BSD-3-Clause
"""Convert the values of a layer to colors.

A color map is a named sequence of colors, such as viridis. RViz messages, web pages and pictures
use the color maps of Matplotlib:
https://matplotlib.org/stable/gallery/color/colormap_reference.html

Colors are red, green and blue in [0, 255]. A layer can also contain packed colors, with one color
in each float32 value; see `grid_map_core_py.conversions`.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import max_of_finites, min_of_finites
from grid_map_core_py.conversions._packed_colors import color_value_to_bytes
from grid_map_core_py.errors import ConfigError, hint, required
from grid_map_core_py.plugins import check

__all__ = ["Coloring", "color_map_names"]

Colors: TypeAlias = npt.NDArray[np.uint8]
"""Colors (..., 3): red, green, blue in [0, 255]."""

MISSING = 128
"""Gray value (red, green and blue) of cells without a value."""

DEFAULT_COLOR_MAP = "viridis"

_STEPS = 256


def _all_color_maps() -> Any:
    return required("matplotlib", "a color map").colormaps


def color_map_names() -> list[str]:
    """Return the names of all color maps except reversed ones.

    Raises:
        MissingPackageError: Matplotlib is not installed.
    """
    return sorted(name for name in _all_color_maps() if not name.endswith("_r"))


def check_color(color: int) -> None:
    """Raise `ConfigError` unless `color` is in the range 0 to 0xFFFFFF (0xRRGGBB)."""
    check(0 <= color <= 0xFFFFFF, "color", f"0 to {0xFFFFFF} (0xRRGGBB)", color)


def is_empty(coloring: "Coloring", values: npt.NDArray[np.float32]) -> bool:
    """Return True if a missing color bound cannot be computed, because no value is finite."""
    return None in (coloring.lower, coloring.upper) and not np.isfinite(values).any()


@dataclass(frozen=True)
class Coloring:
    """Rule for coloring cells: with a color map, with packed colors, or in one color.

    Attributes:
        mode: "intensity" maps the values of `layer` to colors of `color_map`. "color" unpacks the
            colors in `layer`. "flat" uses `color` for all cells.
        layer: name of the layer.
        color_map: name of the color map.
        lower, upper: values at the ends of the color map; None means the smallest and the largest
            finite value. Values outside this range get the color of the nearest end.
        invert: reverse the color map.
        color: color for the mode "flat", 0xRRGGBB.

    Raises:
        ConfigError: the color map is unknown, a bound is not finite, or lower >= upper.
        MissingPackageError: Matplotlib is not installed.
    """

    mode: Literal["intensity", "color", "flat"] = "intensity"
    layer: str = ""
    color_map: str = DEFAULT_COLOR_MAP
    lower: float | None = None
    upper: float | None = None
    invert: bool = False
    color: int = 0xC0C0C0

    def __post_init__(self) -> None:
        _table(self.color_map)
        for name, bound in (("lower", self.lower), ("upper", self.upper)):
            check(bound is None or np.isfinite(bound), name, "a finite number", bound)
        if self.lower is not None and self.upper is not None:
            expected = f"more than lower ({self.lower}); `invert` swaps the colors"
            check(self.lower < self.upper, "upper", expected, self.upper)

    def bounds(self, values: npt.NDArray[np.float32]) -> tuple[float, float]:
        """Return the values at the lower and upper end of the color map for an array of values.

        A missing lower bound is the smallest finite value, but at most `upper`. A missing upper
        bound is the largest finite value, but at least `lower`. Without finite values, a missing
        bound equals the other bound; if both are missing, both are 0.
        """
        lower = min_of_finites(values) if self.lower is None else self.lower
        upper = max_of_finites(values) if self.upper is None else self.upper
        if np.isnan(lower):
            lower = 0.0 if np.isnan(upper) else upper
        if np.isnan(upper):
            upper = lower
        if self.lower is None:
            return min(lower, upper), upper
        return lower, max(lower, upper)

    def __call__(self, values: npt.NDArray[np.float32]) -> Colors:
        """Return the colors (..., 3) for an array (...) of layer values.

        NaN is gray, except in the mode "flat". A color map has 256 colors, each for an equal part
        of the value range.
        """
        if self.mode == "flat":
            one = np.stack(color_value_to_bytes(np.array(self.color)))
            return np.broadcast_to(one, (*values.shape, 3))
        colors: Colors
        if self.mode == "color":
            colors = np.stack(color_value_to_bytes(values), axis=-1)
        else:
            lower, upper = self.bounds(values)
            factor = _STEPS / (upper - lower) if upper > lower else 0.0
            with np.errstate(over="ignore", invalid="ignore"):
                steps = (values - np.float32(lower)) * np.float32(factor)
            # Unlike np.minimum and np.maximum, np.fmin and np.fmax replace NaN with the bound.
            steps = np.fmin(np.fmax(steps, 0), _STEPS - 1)
            table = _table(self.color_map)[:: -1 if self.invert else 1]
            colors = np.take(table, steps.astype(np.uint8), axis=0)
        colors[np.isnan(values)] = MISSING
        return colors


@cache
def _table(name: str) -> Colors:
    maps = _all_color_maps()
    if name not in maps:
        similar = hint(name, maps, 3) or "; such as viridis, turbo, terrain"
        raise ConfigError(
            f"parameter 'color_map': expected a color map of Matplotlib, got {name!r}{similar}"
        )
    colors = maps[name](np.linspace(0.0, 1.0, _STEPS))[:, :3]
    table: Colors = np.rint(255 * colors).astype(np.uint8)
    return table
