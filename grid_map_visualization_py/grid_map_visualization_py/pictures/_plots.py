# SPDX-License-Identifier: BSD-3-Clause
"""Functions that draw maps on Matplotlib axes."""

import math
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check

from .._layers import lit_heights, usual_layer
from ..colors import DEFAULT_COLOR_MAP, MISSING, Coloring
from ..surface import Surface, check_max_drawn_cells
from ._from_above import (
    NO_VALUE,
    add_color_bar,
    add_legend,
    add_scale_bar,
    block_side,
    extent_of,
    lit,
    paint,
)

if TYPE_CHECKING:
    import xarray

    from grid_map_core_py.tiled import TiledMap

AnyMap: TypeAlias = "GridMap | TiledMap | xarray.Dataset | xarray.DataArray"

_FAR = 1e5
"""Smallest x [m] whose tick labels are so long that only a few fit."""

RELIEF_SIZE = (1200, 560)
"""Default width and height of relief pictures [pixels]."""

_GRAY = {"facecolor": 3 * (MISSING / 255,)}
"""Legend style for cells without a value on surfaces and in relief pictures."""


def plot(
    grid_map: AnyMap,
    layer: str = "",
    ax: Any = None,
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
) -> Any:
    """Draw a layer of a map from above.

    Cells without a finite value are hatched in gray. If a map has more than two cells per pixel
    along a side, blocks of cells are averaged. Each block shows the mean of its finite values or
    colors. Blocks with missing values are partly transparent. A tiled map is first downsampled to
    at most four cells per pixel; see `TiledMap.thinned`.

    Args:
        grid_map: a `GridMap`, a `TiledMap`, or an xarray dataset or array.
        layer: layer with the colors; empty means `elevation`, or else the first layer.
        ax: Matplotlib axes to draw on; None means the current axes.
        color_mode: "intensity" maps values to colors of `color_map`, "color" reads packed colors.
        color_map: name of a Matplotlib color map.
        lower, upper: values at the ends of the color map; None means smallest and largest value.
        invert: reverse the color map.
        hillshade: name of the height layer [m] used for hillshading. False means no shading. None
            shades the layer only if it is a height layer. Names of height layers start with
            elevation, height, altitude, DEM, DSM or DTM, and contain no word such as variance,
            slope or color. True also shades other layers, with the heights in `elevation` or the
            first height layer.
        exaggeration: factor by which the heights are scaled for hillshading.
        max_drawn_cells: maximum number of blocks. None adapts the blocks to the pixels, as
            described above; 0 draws every cell.
        scale_bar: draw a scale bar, and a north arrow if the map has a reference system.
        label: label of the color bar; empty means the layer name, with [m] for heights and [rad]
            for slopes.
        title: title above the picture.
        color_bar: draw a color bar, and a legend for cells without a value.

    Returns:
        The Matplotlib axes.

    Raises:
        LayerNotFoundError: the map lacks a layer.
        ConfigError: the color map is unknown, or another option is invalid.
        GridMapError: a tiled map cannot be read.
    """
    _check_options(color_mode, exaggeration)
    check_max_drawn_cells(max_drawn_cells or 0)
    site = _opened(grid_map)
    layer = layer or usual_layer(site)
    coloring = Coloring(color_mode, layer, color_map, lower, upper, invert)
    heights = lit_heights(site, layer, hillshade)
    axes = _current_axes() if ax is None else ax
    side = block_side(axes, site.size, max_drawn_cells)
    drawn_map = _loaded(site, {layer, heights} - {""}, math.prod(site.size) / side**2)
    # The block size changes if a tiled map was downsampled.
    side = block_side(axes, drawn_map.size, max_drawn_cells)
    has_holes = paint(axes, drawn_map, coloring, side, heights, exaggeration)
    _use_plain_ticks(axes)
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    if scale_bar:
        add_scale_bar(axes, has_north=bool(getattr(site, "crs", "")))
    if color_bar:
        bar = None
        if color_mode == "intensity":
            bar = add_color_bar(axes, coloring, drawn_map[layer], label, ax=axes, shrink=0.85)
        if has_holes:
            add_legend(axes, bar, NO_VALUE)
    return axes


def plot_3d(
    grid_map: AnyMap,
    height_layer: str = "",
    ax: Any = None,
    *,
    color_layer: str = "",
    color_mode: Literal["intensity", "color"] = "intensity",
    color_map: str = DEFAULT_COLOR_MAP,
    lower: float | None = None,
    upper: float | None = None,
    invert: bool = False,
    exaggeration: float = 1.0,
    max_drawn_cells: int = 20_000,
    label: str = "",
    title: str = "",
    color_bar: bool = True,
) -> Any:
    """Draw a map as a shaded triangle surface in three dimensions.

    Args:
        grid_map: as for `plot`.
        height_layer: height layer [m]; empty means `elevation`, or else the first layer.
        ax: Matplotlib axes with projection "3d"; None creates new axes.
        color_layer: layer with the colors; if empty, the surface is colored by height.
        color_mode, color_map, lower, upper, invert, label, title, color_bar: as for `plot`.
        exaggeration: factor by which drawn heights are scaled; the z axis shows true heights.
        max_drawn_cells: maximum number of cells; larger maps are downsampled. 0 means no limit.
            Matplotlib needs about one second for the default number.

    Returns the Matplotlib axes. Raises the same errors as `plot`.
    """
    _check_options(color_mode, exaggeration)
    check_max_drawn_cells(max_drawn_cells)
    site = _opened(grid_map)
    height_layer = height_layer or usual_layer(site)
    layer = color_layer or height_layer
    coloring = Coloring(color_mode, layer, color_map, lower, upper, invert)
    axes = _pyplot().figure().add_subplot(projection="3d") if ax is None else ax
    check(axes.name == "3d", "ax", "axes of the projection '3d'", axes.name)
    drawn_map = _loaded(site, {height_layer, layer}, max_drawn_cells or math.inf)
    surface = Surface(drawn_map, height_layer, max_drawn_cells=max_drawn_cells)
    mesh = surface.mesh(coloring)
    x, y, z = (mesh.vertices + mesh.origin).T
    if len(mesh.faces):
        # With antialiasing, the background would be visible between triangles.
        options = {"shade": False, "linewidth": 0, "antialiased": False}
        drawn = axes.plot_trisurf(x, y, z, triangles=mesh.faces, **options)
        corners = mesh.vertices[mesh.faces] * np.array([1.0, 1.0, exaggeration])
        first, second, third = corners.transpose(1, 0, 2)
        colors = mesh.colors[mesh.faces].mean(axis=1) / 255
        drawn.set_facecolor(lit(colors, np.cross(second - first, third - first)))
    x0, x1, y0, y1 = extent_of(drawn_map)
    _use_plain_ticks(axes)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=title)
    axes.set(xlim=(x0, x1), ylim=(y0, y1))
    height = exaggeration * float(np.ptp(z)) if z.size else 0.0
    sides = np.array([x1 - x0, y1 - y0, height])
    axes.set_box_aspect(np.maximum(sides, 0.05 * sides.max()), zoom=0.95)
    axes.view_init(elev=45.0, azim=-60.0)
    # Labels of large coordinates need space.
    axes.xaxis.labelpad = axes.yaxis.labelpad = 12.0
    # The z axis is short, so only a few ticks fit.
    axes.locator_params(axis="z", nbins=3)
    bar = None
    if color_bar and color_mode == "intensity":
        look = {"ax": axes, "shrink": 0.6, "pad": 0.1}
        bar = add_color_bar(axes, coloring, drawn_map[layer], label, **look)
    if color_bar and (~np.isfinite(surface.values(layer)) & surface.valid).any():
        add_legend(axes, bar, _GRAY)
    return axes


def plot_relief(
    grid_map: AnyMap,
    height_layer: str = "",
    ax: Any = None,
    *,
    color_layer: str = "",
    color_mode: Literal["intensity", "color"] = "intensity",
    color_map: str = DEFAULT_COLOR_MAP,
    lower: float | None = None,
    upper: float | None = None,
    invert: bool = False,
    exaggeration: float = 1.0,
    azimuth: float = math.radians(40.0),
    elevation: float = math.radians(25.0),
    size: tuple[int, int] = RELIEF_SIZE,
    label: str = "",
    title: str = "",
    color_bar: bool = True,
) -> Any:
    """Draw a map as a block of terrain in perspective, with sunlight and shadows.

    The surface is drawn at the resolution of the picture, in about one second. The picture has no
    coordinate axes. Use `plot` or `plot_3d` to read positions and heights.

    Args:
        grid_map: as for `plot`.
        height_layer: height layer [m]; empty means `elevation`, or else the first layer. Holes
            are drawn at the height of the nearest cell.
        ax: Matplotlib axes to draw on; None means the current axes.
        color_layer: as for `plot_3d`. Cells without a value are gray.
        color_mode, color_map, lower, upper, invert, label, title, color_bar: as for `plot`.
        exaggeration: factor by which heights are scaled. The drawn height is limited to 20 times
            the longer side of the map.
        azimuth: direction from the map to the camera [rad], measured from +x towards +y.
        elevation: elevation angle of the camera [rad], between 0 and pi / 3.
        size: width and height of the picture [pixels].

    Returns the Matplotlib axes. Raises the same errors as `plot`.
    """
    _check_options(color_mode, exaggeration)
    # The projection of a level camera is extremely stretched near pi / 2.
    check(0 < elevation < math.pi / 3, "elevation", "an angle between 0 and pi / 3", elevation)
    check(math.isfinite(azimuth), "azimuth", "a finite angle", azimuth)
    check(min(size) >= 1, "size", "a width and height of at least 1 pixel", size)
    # Imported here, because SciPy is slow to import.
    from ._relief import MAX_SIDE, draw_relief

    site = _opened(grid_map)
    height_layer = height_layer or usual_layer(site)
    layer = color_layer or height_layer
    coloring = Coloring(color_mode, layer, color_map, lower, upper, invert)
    axes = _pyplot().gca() if ax is None else ax
    cells = MAX_SIDE**2 * min(site.size) / max(site.size)
    drawn_map = _loaded(site, {height_layer, layer}, cells)
    # Rows and columns run along -x and -y; flip them to run along +x and +y.
    heights, values = (drawn_map.unwrapped(name)[::-1, ::-1] for name in (height_layer, layer))
    scale = exaggeration / drawn_map.resolution
    axes.imshow(draw_relief(heights, coloring(values), size, azimuth, elevation, scale))
    axes.set_axis_off()
    axes.set_title(title)
    bar = None
    if color_bar and color_mode == "intensity":
        place = axes.inset_axes((0.02, 0.12, 0.24, 0.025))
        look = {"cax": place, "orientation": "horizontal"}
        bar = add_color_bar(axes, coloring, values, label, **look)
    if color_bar and not np.isfinite(values).all():
        add_legend(axes, bar, _GRAY)
    return axes


def _check_options(color_mode: str, exaggeration: float) -> None:
    modes = "intensity", "color"
    check(color_mode in modes, "color_mode", f"one of {', '.join(modes)}", color_mode)
    is_factor = math.isfinite(exaggeration) and exaggeration > 0
    check(is_factor, "exaggeration", "a positive number", exaggeration)


def _use_plain_ticks(axes: Any) -> None:
    """Write whole coordinates, such as 5399500, at the ticks."""
    with suppress(AttributeError):  # the caller chose other formatters
        axes.ticklabel_format(style="plain", useOffset=False)
        if np.abs(axes.get_xlim()).max() >= _FAR:
            axes.locator_params(axis="x", nbins=4)


def _current_axes() -> Any:
    pyplot = _pyplot()
    if not pyplot.get_fignums():
        pyplot.figure(layout="constrained")  # with space for large coordinates
    return pyplot.gca()


def _pyplot() -> Any:
    # Imported here, because the import searches for a display.
    from matplotlib import pyplot

    return pyplot


def _opened(grid_map: AnyMap) -> "GridMap | TiledMap":
    """Return a `GridMap` unchanged, and open any other map as a tiled map."""
    if isinstance(grid_map, GridMap):
        return grid_map
    # Imported here, because the import is slow.
    from grid_map_core_py.tiled import TiledMap, open_map

    if isinstance(grid_map, TiledMap):
        return grid_map
    source: Any = grid_map
    expected = "a GridMap, a TiledMap, or a Dataset or DataArray of xarray"
    check(hasattr(source, "dims"), "grid_map", expected, source)
    return open_map(source)


def _loaded(site: "GridMap | TiledMap", layers: set[str], cells: float) -> "GridMap":
    """Return a `GridMap` unchanged; load a tiled map with at least `cells` cells."""
    if isinstance(site, GridMap):
        return site
    names = [name for name in site.layers if name in layers] + sorted(layers - {*site.layers})
    steps = math.floor(math.log2(max(1.0, site.size[0] * site.size[1] / cells)) / 2)
    return site.thinned(2**steps, names) if steps else site.to_map(names)
