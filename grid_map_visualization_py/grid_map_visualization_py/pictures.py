# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of maps, drawn by Matplotlib.

`plot` shows a map from above as RViz does: x to the right and y upwards, in meters, in the frame of
the map. Cells without a value are left blank. `plot_3d` draws a surface, and `plot_relief` a block
of terrain in perspective.

The hillshading of `plot` and `plot_3d` has its light in the upper left, 45 degrees high. Level
ground keeps its color, slopes that face the light are lighter and slopes that face away darker.
"""

import math
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Layer
from grid_map_core_py.errors import MissingPackageError
from grid_map_core_py.files import new_file
from grid_map_core_py.plugins import check

from ._relief import draw_relief
from .colors import DEFAULT_COLOR_MAP, REMEDY, Coloring
from .surface import Surface

try:
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap, Normalize
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingPackageError("matplotlib", "a picture", REMEDY) from error

__all__ = ["plot", "plot_3d", "plot_relief", "save_picture"]

LIGHT = np.array([-0.5, 0.5, np.sqrt(0.5)])
"""Direction to the light."""

_RELIEF_SIZE = (1200, 560)
"""Default width and height of pictures of terrain in relief [pixels]."""


def plot(
    grid_map: GridMap,
    layer: str,
    ax: Any = None,
    *,
    color_mode: Literal["intensity", "color"] = "intensity",
    color_map: str = DEFAULT_COLOR_MAP,
    lower: float | None = None,
    upper: float | None = None,
    invert: bool = False,
    shade_by: str = "",
    exaggeration: float = 1.0,
    label: str = "",
    title: str = "",
    color_bar: bool = True,
) -> Any:
    """Draw a layer from above.

    Args:
        grid_map: the map.
        layer: layer that gives the colors.
        ax: Matplotlib axes to draw on. None stands for the current axes, as in Matplotlib's own
            functions.
        color_mode: "intensity" maps values by the color map, "color" reads packed colors.
        color_map: name of a color map of Matplotlib.
        lower, upper: values at the ends of the color map; None stands for the smallest and largest.
        invert: swap the ends of the color map.
        shade_by: layer of heights [m] for hillshading; empty for none.
        exaggeration: factor on the heights for hillshading.
        label: label of the color bar; empty stands for the name of the layer.
        title: title above the picture.
        color_bar: draw a color bar.

    Returns:
        The axes.

    Raises:
        LayerNotFoundError: the map lacks a layer.
        ConfigError: the color map is unknown, or another option is invalid.
    """
    _check_options(color_mode, exaggeration)
    coloring = Coloring(color_mode, layer, color_map, lower, upper, invert)
    axes = _pyplot().gca() if ax is None else ax
    values = _upright(grid_map.unwrapped(layer))
    bar = _mappable(coloring, values)
    if color_mode == "intensity" and not shade_by:
        # An image of values instead of colors lets Matplotlib show the value under the pointer.
        pixels: Any = np.ma.masked_invalid(values)
    else:
        pixels = np.concatenate([coloring(values) / 255, ~np.isnan(values)[..., None]], axis=-1)
    if shade_by:
        heights = _upright(grid_map.unwrapped(shade_by)) * np.float32(exaggeration)
        pixels[..., :3] = _lit(pixels[..., :3], _grid_normals(heights, grid_map.resolution))
    options = {"cmap": bar.cmap, "norm": bar.norm, "interpolation": "nearest", "origin": "upper"}
    axes.imshow(pixels, extent=_extent(grid_map), **options)
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    if color_bar and color_mode == "intensity":
        axes.figure.colorbar(bar, ax=axes, label=label or layer, shrink=0.85)
    return axes


def plot_3d(
    grid_map: GridMap,
    height_layer: str,
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
    """Draw a map as a shaded surface of triangles in three dimensions.

    Args:
        grid_map: the map.
        height_layer: heights [m].
        ax: Matplotlib axes of the projection "3d"; None stands for new ones.
        color_layer: layer that gives the colors; empty stands for the heights.
        color_mode, color_map, lower, upper, invert, label, title, color_bar: as for `plot`.
        exaggeration: factor on the drawn heights. The axis shows true heights.
        max_drawn_cells: limit of the cells, to which larger maps are thinned out; 0 for no limit.
            Matplotlib draws the default number in about a second.

    Returns the axes, and raises the errors of `plot`.
    """
    _check_options(color_mode, exaggeration)
    layer = color_layer or height_layer
    coloring = Coloring(color_mode, layer, color_map, lower, upper, invert)
    axes = _pyplot().figure().add_subplot(projection="3d") if ax is None else ax
    check(axes.name == "3d", "ax", "axes of the projection '3d'", axes.name)
    surface = Surface(grid_map, height_layer, max_drawn_cells=max_drawn_cells)
    mesh = surface.mesh(coloring)
    x, y, z = (mesh.vertices + mesh.origin).T
    if len(mesh.faces):
        # With antialiasing the background shows between the triangles.
        options = {"shade": False, "linewidth": 0, "antialiased": False}
        drawn = axes.plot_trisurf(x, y, z, triangles=mesh.faces, **options)
        corners = mesh.vertices[mesh.faces] * np.array([1.0, 1.0, exaggeration])
        first, second, third = corners.transpose(1, 0, 2)
        colors = mesh.colors[mesh.faces].mean(axis=1) / 255
        drawn.set_facecolor(_lit(colors, np.cross(second - first, third - first)))
    x0, x1, y0, y1 = _extent(grid_map)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=title)
    axes.set(xlim=(x0, x1), ylim=(y0, y1))
    height = exaggeration * float(np.ptp(z)) if z.size else 0.0
    sides = np.array([x1 - x0, y1 - y0, height])
    axes.set_box_aspect(np.maximum(sides, 0.05 * sides.max()), zoom=0.95)
    axes.view_init(elev=45.0, azim=-60.0)
    # The z axis is short, with room for few ticks.
    axes.locator_params(axis="z", nbins=3)
    if color_bar and color_mode == "intensity":
        bar = _mappable(coloring, grid_map[layer])
        axes.figure.colorbar(bar, ax=axes, label=label or layer, shrink=0.6, pad=0.1)
    return axes


def plot_relief(
    grid_map: GridMap,
    height_layer: str,
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
    size: tuple[int, int] = _RELIEF_SIZE,
    label: str = "",
    title: str = "",
    color_bar: bool = True,
) -> Any:
    """Draw a map as a block of terrain in perspective, with sunlight and shadows.

    The surface is drawn at the resolution of the picture, in about a second. There are no axes:
    use `plot` or `plot_3d` to read positions and heights.

    Args:
        grid_map: the map.
        height_layer: heights [m]. Holes get the height of the nearest cell.
        ax: Matplotlib axes to draw on; None stands for the current ones.
        color_layer: layer that gives the colors; empty stands for the heights. Cells without a
            value are gray.
        color_mode, color_map, lower, upper, invert, label, title, color_bar: as for `plot`.
        exaggeration: factor on the heights.
        azimuth: direction from the map to the camera [rad], from +x towards +y.
        elevation: angle of the camera above the ground [rad], between 0 and pi / 3.
        size: width and height of the picture [pixels].

    Returns the axes, and raises the errors of `plot`.
    """
    _check_options(color_mode, exaggeration)
    # Near pi / 2, the picture of a level camera is stretched beyond recognition.
    check(0 < elevation < math.pi / 3, "elevation", "an angle between 0 and pi / 3", elevation)
    check(math.isfinite(azimuth), "azimuth", "a finite angle", azimuth)
    check(min(size) >= 1, "size", "a width and height of at least 1 pixel", size)
    layer = color_layer or height_layer
    coloring = Coloring(color_mode, layer, color_map, lower, upper, invert)
    axes = _pyplot().gca() if ax is None else ax
    # Along +x and +y, while rows and columns run along -x and -y.
    heights, values = (grid_map.unwrapped(name)[::-1, ::-1] for name in (height_layer, layer))
    in_cells = heights * (exaggeration / grid_map.resolution)
    axes.imshow(draw_relief(in_cells, coloring(values), size, azimuth, elevation))
    axes.set_axis_off()
    axes.set_title(title)
    if color_bar and color_mode == "intensity":
        place = axes.inset_axes((0.02, 0.12, 0.24, 0.025))
        bar = _mappable(coloring, values)
        axes.figure.colorbar(bar, cax=place, orientation="horizontal", label=label or layer)
    return axes


def save_picture(
    grid_map: GridMap,
    layer: str,
    path: str | PathLike[str],
    *,
    style: Literal["flat", "surface", "relief"] = "flat",
    dpi: float = 110,
    **options: Any,
) -> None:
    """Write a picture of a map to a file, which appears complete or not at all.

    Args:
        grid_map: the map.
        layer: gives the colors of a flat picture, else the heights.
        path: the file, whose ending decides its format: .jpeg, .jpg, .pdf, .png or .svg. An
            existing one is replaced.
        style: "flat" draws as `plot` does, "surface" as `plot_3d` and "relief" as `plot_relief`.
        dpi: pixels per inch.
        options: those of that function, except `ax`.

    Raises:
        LayerNotFoundError: the map lacks a layer.
        ConfigError: the color map is unknown, the name has another ending, or another option is
            invalid.
        OSError: the file cannot be written.
    """
    styles, endings = ("flat", "surface", "relief"), (".jpeg", ".jpg", ".pdf", ".png", ".svg")
    check(style in styles, "style", f"one of {', '.join(styles)}", style)
    ending = Path(path).suffix.lower()
    expected = f"a name that ends in {', '.join(endings)}"
    check(ending in endings, "path", expected, Path(path).name)
    figure = Figure(figsize=(9.0, 7.0), dpi=dpi, layout="constrained")
    if style == "flat":
        plot(grid_map, layer, figure.add_subplot(), **options)
    elif style == "surface":
        plot_3d(grid_map, layer, figure.add_subplot(projection="3d"), **options)
    else:
        # One pixel of the relief per pixel of the picture.
        figure.set_layout_engine("none")
        width, height = options.get("size", _RELIEF_SIZE)
        figure.set_size_inches(width / dpi, height / dpi)
        top = 0.93 if options.get("title") else 1.0
        plot_relief(grid_map, layer, figure.add_axes((0.0, 0.0, 1.0, top)), **options)
    # On a full disk, Matplotlib raises errors of its own for PDF files.
    picture = BytesIO()
    figure.savefig(picture, format=ending[1:])
    with new_file(path) as temporary:
        temporary.write_bytes(picture.getbuffer())


def _check_options(color_mode: str, exaggeration: float) -> None:
    modes = "intensity", "color"
    check(color_mode in modes, "color_mode", f"one of {', '.join(modes)}", color_mode)
    is_factor = math.isfinite(exaggeration) and exaggeration > 0
    check(is_factor, "exaggeration", "a positive number", exaggeration)


def _mappable(coloring: Coloring, values: Layer) -> ScalarMappable:
    """Return the color map and its bounds in the form that Matplotlib needs for a color bar."""
    colors: Colormap = matplotlib.colormaps[coloring.color_map]
    return ScalarMappable(
        Normalize(*coloring.bounds(values)), colors.reversed() if coloring.invert else colors
    )


def _lit(colors: npt.NDArray[np.floating], normals: npt.NDArray[np.floating]) -> Any:
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


def _upright(values: Layer) -> Layer:
    """Return a layer in map order as an image with x to the right and y upwards: (cols, rows)."""
    return values[::-1, :].T


def _extent(grid_map: GridMap) -> tuple[float, float, float, float]:
    """Return the smallest and largest x, then y, of the map [m]."""
    (x0, y0), (x1, y1) = (grid_map.position + side * 0.5 * grid_map.length for side in (-1.0, 1.0))
    return float(x0), float(x1), float(y0), float(y1)


def _pyplot() -> Any:
    # Imported late, because the import looks for a display.
    from matplotlib import pyplot

    return pyplot
