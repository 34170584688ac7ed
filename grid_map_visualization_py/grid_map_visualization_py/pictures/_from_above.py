# SPDX-License-Identifier: BSD-3-Clause
"""Draw a layer from above, with hillshading, holes, a scale bar and a north arrow."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.image import AxesImage
from matplotlib.offsetbox import AnchoredText
from matplotlib.patches import Patch, Rectangle
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer, slices
from grid_map_core_py.conversions._packed_colors import color_value_to_bytes

from .._layers import titled
from ..colors import Coloring, is_empty

LIGHT = np.array([-0.5, 0.5, np.sqrt(0.5)])
"""Unit vector towards the light (x, y, z)."""

NO_VALUE: dict[str, Any] = {
    "facecolor": "0.9",
    "edgecolor": "0.6",
    "hatch": "////",
    "linewidth": 0.0,
}
"""Style of cells without a value."""

_LEAST, _MOST = 1 / 3, 2 / 3
"""Minimum and maximum opacity of blocks in which only some cells have a value."""

_STRIP = 1 << 18
"""Maximum number of cells that are reduced at once, so that they fit in the cache."""

_FRAME = {"facecolor": "white", "edgecolor": "none", "alpha": 0.7}


class Blocks(NamedTuple):
    """Image of a map with one pixel per block of cells.

    Attributes:
        means: (height, width, channels) mean of the finite values; NaN in empty blocks.
        opacity: (height, width); 1 for full blocks, 0 for empty blocks, 1/3 to 2/3 for others.
    """

    means: npt.NDArray[np.float32]
    opacity: npt.NDArray[np.float32]


def block_side(axes: Any, size: tuple[int, int], max_drawn_cells: int | None) -> int:
    """Return the side length [cells] of the blocks that become one pixel each."""
    if max_drawn_cells is not None:
        return max(1, math.ceil(math.sqrt(size[0] * size[1] / (max_drawn_cells or math.inf))))
    # A color bar uses a fifth of the axes.
    box = axes.get_window_extent()
    cells = max(size[0] / (0.8 * box.width), size[1] / box.height)
    # Matplotlib resamples images well up to twice the size of the axes.
    return math.ceil(cells) if cells > 2 else 1


def paint(
    axes: Any, grid_map: GridMap, coloring: Coloring, side: int, heights: str, exaggeration: float
) -> bool:
    """Draw a map on axes, and return True if some cells have no value.

    Each block of `side` x `side` cells becomes one pixel. `heights` is the height layer for
    hillshading; empty means no hillshading.
    """
    is_color = coloring.mode == "color"
    layer = grid_map.unwrapped(coloring.layer)
    # The bounds are computed from all cells, before the reduction.
    bar = mappable(coloring, layer)
    means, opacity = reduced(layer, side, is_color=is_color)
    values = np.ma.masked_invalid(means[..., 0])
    x0, x1, y0, y1 = extent_of(grid_map)
    # Blocks start at the largest x and y; the last blocks may extend beyond the map.
    cells = side * grid_map.resolution
    height, width = opacity.shape
    reach = x1 - cells * width, x1, y1 - cells * height, y1
    # Cells larger than pixels have sharp edges; smaller cells are averaged.
    options: dict[str, Any] = {"interpolation": "antialiased", "extent": reach}
    if is_color or heights:
        colors = means / 255 if is_color else bar.cmap(bar.norm(values.astype(float)))[..., :3]
        if heights:
            z = reduced(grid_map.unwrapped(heights), side).means[..., 0].astype(np.float64)
            with np.errstate(invalid="ignore"):
                # Central differences, one-sided at the border, zero along an axis of one cell.
                down, right = (
                    (np.gradient(z, axis=axis) if z.shape[axis] > 1 else 0 * z)
                    * (exaggeration / cells)
                    for axis in (0, 1)
                )
            colors = lit(colors, np.stack([-right, down, np.ones_like(z)], axis=-1))
        image = axes.imshow(np.dstack([np.nan_to_num(colors), opacity]), **options)
        if not is_color:
            # Make Matplotlib show the layer value, not the lit color, at the mouse pointer.
            told = AxesImage(axes, cmap=bar.cmap, norm=bar.norm, extent=reach)
            told.set_data(values)
            told.set_transform(image.get_transform())
            image.get_cursor_data = told.get_cursor_data
            image.format_cursor_data = told.format_cursor_data
    else:
        is_partial = (opacity[opacity > 0] < 1).any()
        options |= {"alpha": opacity} if is_partial else {}
        axes.imshow(values, cmap=bar.cmap, norm=bar.norm, **options)
    has_holes = bool((opacity < 1).any())
    if has_holes:
        axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, zorder=-1, **NO_VALUE))
    axes.set(xlim=(x0, x1), ylim=(y0, y1))
    return has_holes


def add_color_bar(axes: Any, coloring: Coloring, values: Layer, label: str, **look: Any) -> Any:
    """Add a color bar for a layer, without ticks if the value range is unknown."""
    without = is_empty(coloring, values)
    look["label"] = titled(coloring.layer, label, is_empty=without)
    look |= {"ticks": []} if without else {}
    return axes.figure.colorbar(mappable(coloring, values), **look)


def mappable(coloring: Coloring, values: Layer) -> Any:
    """Return a Matplotlib `ScalarMappable` with the color map and the bounds, for a color bar."""
    colors = colormaps[coloring.color_map]
    return ScalarMappable(
        Normalize(*coloring.bounds(values)), colors.reversed() if coloring.invert else colors
    )


def add_legend(axes: Any, bar: Any, look: dict[str, Any]) -> None:
    """Add a legend for cells without a value, next to the color bar if there is one."""
    place, corner, at = axes, "upper left", (1.0, 1.0)
    if bar is not None:
        is_upright = bar.orientation == "vertical"
        place, at = bar.ax, (0.0, -0.02) if is_upright else (0.0, 1.0)
        corner = "upper left" if is_upright else "lower left"
    size = {"handlelength": 1.2, "borderpad": 0.0, "borderaxespad": 0.4, "fontsize": "small"}
    known = {"loc": corner, "bbox_to_anchor": at, "frameon": False} | size
    place.legend(handles=[Patch(label="no value", **look)], **known)


def extent_of(grid_map: GridMap) -> tuple[float, float, float, float]:
    """Return the extent of the map: smallest x, largest x, smallest y, largest y [m]."""
    (x0, y0), (x1, y1) = (grid_map.position + side * 0.5 * grid_map.length for side in (-1.0, 1.0))
    return float(x0), float(x1), float(y0), float(y1)


def reduced(layer: Layer, side: int, *, is_color: bool = False) -> Blocks:
    """Return an image of a layer in map order, with x to the right and y upwards.

    Each block of `side` x `side` cells becomes one pixel. Blocks start at the largest x and y.
    If `is_color` is true, packed colors become red, green and blue.
    """
    turned = layer.T
    columns, rows = turned.shape
    height, width = -(-columns // side), -(-rows // side)
    means = np.empty((height, width, 3 if is_color else 1), np.float32)
    share = np.empty((height, width), np.float32)
    for part in slices(height, _STRIP // (side * rows)):
        strip = turned[side * part.start : side * part.stop]
        finite = np.isfinite(strip)
        channels = np.stack(color_value_to_bytes(strip), -1) if is_color else strip[..., None]
        counts = _block_sums(finite, side)
        sums = _block_sums(np.where(finite[..., None], channels, 0), side)
        with np.errstate(invalid="ignore"):
            means[part] = sums / counts[..., None]
        share[part] = counts / _block_sums(np.ones_like(finite), side)
    visible = np.where(share > 0, np.clip(share, _LEAST, _MOST), 0)
    opacity = np.where(share == 1, 1, visible).astype(np.float32)
    return Blocks(means[:, ::-1], opacity[:, ::-1])


def _block_sums(cells: npt.NDArray[Any], side: int) -> npt.NDArray[np.float64]:
    """Return the sums over blocks of `side` x `side` cells along the first two axes."""
    for axis in (0, 1):
        parts = [cells[(slice(None),) * axis + (slice(n, None, side),)] for n in range(side)]
        cells = parts[0].astype(np.float64)
        for part in parts[1:]:
            cells[(slice(None),) * axis + (slice(part.shape[axis]),)] += part
    return cells


def lit(colors: npt.NDArray[np.floating], normals: npt.NDArray[np.floating]) -> Any:
    """Return hillshaded colors (..., 3) in [0, 1]; colors with a NaN normal stay unchanged.

    The blend mode "soft light" (Pegtop) keeps the colors of level ground.
    """
    with np.errstate(invalid="ignore"):
        normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    light = np.clip(0.5 * (normals @ LIGHT) / LIGHT[2], 0.0, 1.0)
    light = np.where(np.isnan(light), 0.5, light)[..., None]
    return (1 - 2 * light) * colors**2 + 2 * light * colors


def add_scale_bar(axes: Any, *, has_north: bool) -> None:
    """Add a scale bar of 1, 2 or 5 times a power of ten meters, at most 1/4 of the axes wide.

    If `has_north` is true, also add a north arrow, which points along +y (grid north).
    """
    x0, x1 = axes.get_xlim()
    most = (x1 - x0) / 4
    power = 10.0 ** math.floor(math.log10(most))
    # `power` is at most `most`, up to a rounding error of the logarithm.
    length = max((n * power for n in (2, 5) if n * power <= most), default=power)
    units = {1000.0: "km", 1.0: "m", 0.01: "cm", 0.001: "mm"}
    unit = next((unit for unit in units if length >= unit), 0.001)
    text = f"{length / unit:.6g} {units[unit]}"
    signs: list[Any] = [
        AnchoredSizeBar(axes.transData, length, text, "lower left", pad=0.3, borderpad=0.4, sep=3)
    ]
    if has_north:
        signs.append(AnchoredText("▲\nN", "upper right", pad=0.2, borderpad=0.4))
    for sign in signs:
        sign.patch.set(**_FRAME)
        axes.add_artist(sign)
