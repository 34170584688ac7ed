# SPDX-License-Identifier: BSD-3-Clause
"""The picture of a layer from above: colors, light, holes, scale bar and arrow to the north.

Larger maps are reduced before they are drawn. A block of cells becomes one cell with the mean of
their values, or of their red, green and blue. Where some of them have no value, the block is drawn
half transparent, so that neither a single hole nor a single value disappears.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.image import AxesImage
from matplotlib.offsetbox import AnchoredText
from matplotlib.patches import Patch, Rectangle

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer, slices
from grid_map_core_py.conversions import color_value_to_bytes
from grid_map_core_py.plugins import check

from ._kinds import lit_heights, titled, usual_layer
from .colors import DEFAULT_COLOR_MAP, Coloring
from .surface import check_max_drawn_cells

if TYPE_CHECKING:
    from grid_map_core_py.tiled import TiledMap

Extent: TypeAlias = tuple[float, float, float, float]
"""Smallest and largest x, then y [m]."""

LIGHT = np.array([-0.5, 0.5, np.sqrt(0.5)])
"""Direction to the light."""

NO_VALUE: dict[str, Any] = {
    "facecolor": "0.9",
    "edgecolor": "0.6",
    "hatch": "////",
    "linewidth": 0.0,
}
"""Look of cells without a value."""

_LEAST, _MOST = 1 / 3, 2 / 3
"""Opacity of a block of which few, or nearly all, cells have a value."""

_STRIP = 2**20
"""Cells that are reduced at once."""

_FRAME = {"facecolor": "white", "edgecolor": "none", "alpha": 0.7}


class Blocks(NamedTuple):
    """A reduced image.

    Attributes:
        means: (height, width, channels) of the cells with a value; NaN in blocks without one.
        opacity: (height, width): 1 for a full block, 0 for an empty one.
    """

    means: npt.NDArray[np.float32]
    opacity: npt.NDArray[np.float32]


@dataclass(frozen=True)
class Flat:
    """The look of a picture from above.

    Attributes:
        coloring: colors of the cells.
        heights: layer that the light falls on; empty for no light.
        exaggeration: factor on these heights.
        max_drawn_cells: limit of the drawn cells; 0 for none, None for the pixels of the axes.
        scale_bar: draw a scale bar, and an arrow to the north if `has_north`.
        has_north: y is north.
        label, title, color_bar: see `plot`.
    """

    coloring: Coloring
    heights: str
    exaggeration: float
    max_drawn_cells: int | None
    scale_bar: bool
    has_north: bool
    label: str
    title: str
    color_bar: bool

    def side(self, axes: Any, size: tuple[int, int]) -> int:
        """Return the side of a block of a map of some rows and columns [cells]."""
        if self.max_drawn_cells is not None:
            limit = self.max_drawn_cells or math.inf
            return max(1, math.ceil(math.sqrt(size[0] * size[1] / limit)))
        # A color bar takes a fifth of the axes.
        box = axes.get_window_extent()
        cells = max(size[0] / (0.8 * box.width), size[1] / box.height)
        # Matplotlib itself reduces images well that are at most twice as large.
        return math.ceil(cells) if cells > 2 else 1

    @property
    def layers(self) -> set[str]:
        """Names of the layers that are needed."""
        return {self.coloring.layer, self.heights} - {""}

    def needs(self, axes: Any, size: tuple[int, int]) -> tuple[set[str], float]:
        """Return the layers and the number of cells that a picture of a map needs."""
        return self.layers, size[0] * size[1] / self.side(axes, size) ** 2

    def paint(self, axes: Any, grid_map: GridMap, view: Extent | None = None) -> tuple[Any, bool]:
        """Draw the map; return its color map and bounds, and whether cells have no value.

        Args:
            axes: an empty plot.
            grid_map: the map.
            view: what the axes show; None stands for the map.
        """
        is_color = self.coloring.mode == "color"
        side = self.side(axes, grid_map.size)
        layer = grid_map.unwrapped(self.coloring.layer)
        # The bounds are those of all cells.
        bar = mappable(self.coloring, layer)
        means, opacity = reduced(layer, side, _channels if is_color else _itself)
        values = np.ma.masked_invalid(means[..., 0])
        extent = x0, x1, y0, y1 = extent_of(grid_map)
        # The blocks begin at the largest x and y; those at the other ends may reach beyond the map.
        cells = side * grid_map.resolution
        height, width = opacity.shape
        reach = x1 - cells * width, x1, y1 - cells * height, y1
        # Sharp when cells are larger than pixels, and else without cells that disappear.
        options: dict[str, Any] = {"interpolation": "antialiased", "extent": reach}
        if is_color or self.heights:
            colors = means / 255 if is_color else bar.cmap(bar.norm(values.astype(float)))[..., :3]
            if self.heights:
                heights = reduced(grid_map.unwrapped(self.heights), side).means[..., 0]
                colors = lit(colors, _grid_normals(heights, cells / self.exaggeration))
            image = axes.imshow(np.dstack([np.nan_to_num(colors), opacity]), **options)
            if not is_color:
                _tell_values(image, values, bar)
        else:
            is_partial = (opacity[opacity > 0] < 1).any()
            options |= {"alpha": opacity} if is_partial else {}
            axes.imshow(values, cmap=bar.cmap, norm=bar.norm, **options)
        has_holes = bool((opacity < 1).any())
        if has_holes:
            axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, zorder=-1, **NO_VALUE))
        view = view or extent
        axes.set(xlabel="x [m]", ylabel="y [m]", xlim=view[:2], ylim=view[2:], title=self.title)
        if self.scale_bar:
            _add_scale_bar(axes, view[1] - view[0])
            if self.has_north:
                _add_north(axes)
        return bar, has_holes

    def explain(self, axes: Any, bar: Any, *, has_holes: bool) -> None:
        """Draw the color bar, and say how cells without a value look."""
        if not self.color_bar:
            return
        drawn = None
        if self.coloring.mode == "intensity":
            label = self.label or titled(self.coloring.layer)
            drawn = axes.figure.colorbar(bar, ax=axes, label=label, shrink=0.85)
        if has_holes:
            add_legend(axes, drawn, NO_VALUE)


def flat_of(
    site: "GridMap | TiledMap",
    layer: str = "",
    *,
    color_mode: Literal["intensity", "color"] = "intensity",
    color_map: str = DEFAULT_COLOR_MAP,
    lower: float | None = None,
    upper: float | None = None,
    invert: bool = False,
    hillshade: bool | str | None = None,
    exaggeration: float = 1.0,
    max_drawn_cells: int | None = None,
    scale_bar: bool = True,
    label: str = "",
    title: str = "",
    color_bar: bool = True,
) -> Flat:
    """Return the look of a picture with the options of `plot`."""
    check_options(color_mode, exaggeration)
    check_max_drawn_cells(max_drawn_cells or 0)
    layer = layer or usual_layer(site)
    return Flat(
        Coloring(color_mode, layer, color_map, lower, upper, invert),
        lit_heights(site, layer, hillshade),
        exaggeration,
        max_drawn_cells,
        scale_bar,
        has_north=bool(getattr(site, "crs", "")),
        label=label,
        title=title,
        color_bar=color_bar,
    )


def check_options(color_mode: str, exaggeration: float) -> None:
    """Raise `ConfigError` if an option of all pictures is invalid."""
    modes = "intensity", "color"
    check(color_mode in modes, "color_mode", f"one of {', '.join(modes)}", color_mode)
    is_factor = math.isfinite(exaggeration) and exaggeration > 0
    check(is_factor, "exaggeration", "a positive number", exaggeration)


def mappable(coloring: Coloring, values: Layer) -> Any:
    """Return the color map and its bounds in the form that Matplotlib needs for a color bar."""
    colors: Colormap = colormaps[coloring.color_map]
    return ScalarMappable(
        Normalize(*coloring.bounds(values)), colors.reversed() if coloring.invert else colors
    )


def add_legend(axes: Any, bar: Any, look: dict[str, Any]) -> None:
    """Say how cells without a value look, at the end of the color bar if there is one."""
    place, corner, at = axes, "upper left", (1.0, 1.0)
    if bar is not None:
        is_upright = bar.orientation == "vertical"
        place, at = bar.ax, (0.0, -0.02) if is_upright else (0.0, 1.0)
        corner = "upper left" if is_upright else "lower left"
    size = {"handlelength": 1.2, "borderpad": 0.0, "borderaxespad": 0.4, "fontsize": "small"}
    known = {"loc": corner, "bbox_to_anchor": at, "frameon": False} | size
    place.legend(handles=[Patch(label="no value", **look)], **known)


def extent_of(grid_map: GridMap) -> Extent:
    """Return the smallest and largest x, then y, of the map [m]."""
    (x0, y0), (x1, y1) = (grid_map.position + side * 0.5 * grid_map.length for side in (-1.0, 1.0))
    return float(x0), float(x1), float(y0), float(y1)


# --- blocks of cells ------------------------------------------------------------------------------


def _itself(values: Layer) -> npt.NDArray[Any]:
    return values[..., None]


def _channels(values: Layer) -> npt.NDArray[Any]:
    return np.stack(color_value_to_bytes(values), axis=-1)


def reduced(
    layer: Layer, side: int, split: Callable[[Layer], npt.NDArray[Any]] = _itself
) -> Blocks:
    """Return a layer in map order as an image with x to the right and y upwards.

    Args:
        layer: (rows, columns).
        side: rows and columns of cells for a pixel; counted from the largest x and y.
        split: returns the channels (..., channels) of values (...).
    """
    turned = layer.T
    rows, columns = turned.shape
    height, width = -(-rows // side), -(-columns // side)
    means = np.empty((height, width, split(turned[:1, :1]).shape[-1]), np.float32)
    share = np.empty((height, width), np.float32)
    for part in slices(height, _STRIP // (side * columns)):
        strip = turned[part.start * side : part.stop * side]
        finite = np.isfinite(strip)
        counts = _sums(finite, side)
        # A cell without a value counts for nothing.
        sums = _sums(np.where(finite[..., None], split(strip), 0), side)
        with np.errstate(invalid="ignore"):
            means[part] = sums / counts[..., None]
        share[part] = counts / _sums(np.ones_like(finite), side)
    visible = np.where(share > 0, np.clip(share, _LEAST, _MOST), 0)
    opacity = np.where(share == 1, 1, visible).astype(np.float32)
    return Blocks(means[:, ::-1], opacity[:, ::-1])


def _sums(cells: npt.NDArray[Any], side: int) -> npt.NDArray[np.float64]:
    """Return the sums over blocks of rows and columns, the first two axes."""
    for axis in (0, 1):
        parts = [cells[(slice(None),) * axis + (slice(n, None, side),)] for n in range(side)]
        cells = parts[0].astype(np.float64)
        for part in parts[1:]:
            cells[(slice(None),) * axis + (slice(part.shape[axis]),)] += part
    return cells


# --- light ----------------------------------------------------------------------------------------


def lit(colors: npt.NDArray[np.floating], normals: npt.NDArray[np.floating]) -> Any:
    """Return lit colors (..., 3) in [0, 1]; unchanged where a normal (..., 3) is NaN.

    The blend mode is "soft light" (Pegtop), which keeps colors at a light of one half.
    """
    with np.errstate(invalid="ignore"):
        normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    light = np.clip(0.5 * (normals @ LIGHT) / LIGHT[2], 0.0, 1.0)
    light = np.where(np.isnan(light), 0.5, light)[..., None]
    return (1 - 2 * light) * colors**2 + 2 * light * colors


def _grid_normals(heights: Layer, resolution: float) -> npt.NDArray[np.float64]:
    """Return normals (..., 3) of an upright image of heights; NaN where unknown."""
    z = heights.astype(np.float64)
    with np.errstate(invalid="ignore"):
        # Central differences, one-sided at the border, zero along a single cell.
        down, right = (
            (np.gradient(z, axis=axis) if z.shape[axis] > 1 else 0 * z) / resolution
            for axis in (0, 1)
        )
    return np.stack([-right, down, np.ones_like(down)], axis=-1)


# --- what stands on the picture -------------------------------------------------------------------


def _tell_values(image: Any, values: Any, bar: Any) -> None:
    """Let Matplotlib show the value under the pointer of an image of colors."""
    told = AxesImage(image.axes, cmap=bar.cmap, norm=bar.norm, extent=image.get_extent())
    told.set_data(values)
    told.set_transform(image.get_transform())
    image.get_cursor_data = told.get_cursor_data
    image.format_cursor_data = told.format_cursor_data


def _add_scale_bar(axes: Any, width: float) -> None:
    """Add a bar of 1, 2 or 5 times a power of ten meters, at most a quarter of the map."""
    from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

    power = 10.0 ** math.floor(math.log10(width / 4))
    # The logarithm may be rounded up.
    length = max((n * power for n in (2, 5) if n * power <= width / 4), default=power)
    units = {1000.0: "km", 1.0: "m", 0.01: "cm", 0.001: "mm"}
    unit = next((unit for unit in units if length >= unit), 0.001)
    text = f"{length / unit:.6g} {units[unit]}"
    bar = AnchoredSizeBar(axes.transData, length, text, "lower left", pad=0.3, borderpad=0.4, sep=3)
    bar.patch.set(**_FRAME)
    axes.add_artist(bar)


def _add_north(axes: Any) -> None:
    """Add an arrow to the north of the grid, which is the direction of y."""
    north = AnchoredText("▲\nN", "upper right", pad=0.2, borderpad=0.4)
    north.patch.set(**_FRAME)
    axes.add_artist(north)
