# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of maps, drawn by Matplotlib.

`plot` shows a map from above as RViz does: x to the right and y upwards, in meters, in the frame of
the map. `plot_3d` draws a surface, and `plot_relief` a block of terrain in perspective. They take a
`GridMap`, a `TiledMap`, or a dataset or an array of xarray; of maps that are larger than the
picture, they read and draw what it can show.

The hillshading of `plot` and `plot_3d` has its light in the upper left, 45 degrees high. Level
ground keeps its color, slopes that face the light are lighter and slopes that face away darker.
"""

import math
from collections.abc import Callable, Sequence
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np

from grid_map_core_py.errors import MissingPackageError
from grid_map_core_py.files import MapRecord, new_file
from grid_map_core_py.plugins import check

from ._kinds import AnyMap, loaded, opened, titled, usual_layer
from .colors import DEFAULT_COLOR_MAP, MISSING, REMEDY, Coloring
from .surface import Surface, check_max_drawn_cells

try:
    from matplotlib.figure import Figure

    from ._flat import add_legend, check_options, extent_of, flat_of, lit, mappable
except ImportError as error:
    raise MissingPackageError("matplotlib", "a picture", REMEDY) from error

__all__ = ["plot", "plot_3d", "plot_relief", "save_animation", "save_picture"]

_RELIEF_SIZE = (1200, 560)
"""Default width and height of pictures of terrain in relief [pixels]."""

_GRAY = {"facecolor": 3 * (MISSING / 255,)}
"""Look of cells without a value on surfaces and in relief."""


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
    """Draw a layer from above.

    Cells without a finite value are hatched in gray. If the sides of the map have more than twice
    as many cells as the axes have pixels, blocks of cells are drawn: each has the mean of its
    finite values, or of their red, green and blue, and is half transparent if it has a hole. A
    tiled map is thinned before, see `TiledMap.thinned`, to up to four cells per pixel.

    Args:
        grid_map: the map: in memory, tiled, or a dataset or an array of xarray.
        layer: layer that gives the colors; empty stands for `elevation`, or else the first.
        ax: Matplotlib axes to draw on. None stands for the current axes, as in Matplotlib's own
            functions.
        color_mode: "intensity" maps values by the color map, "color" reads packed colors.
        color_map: name of a color map of Matplotlib.
        lower, upper: values at the ends of the color map; None stands for the smallest and largest.
        invert: swap the ends of the color map.
        hillshade: layer of heights [m] that the light falls on. None lights layers of heights,
            which are known by name: it begins with elevation, height, altitude, DEM, DSM or DTM,
            without a word such as variance, slope or color. True takes for other layers the heights
            of the map, `elevation` or the first layer with such a name. False lights nothing.
        exaggeration: factor on the heights for hillshading.
        max_drawn_cells: limit of the drawn blocks; None for the pixels of the axes, 0 for none.
        scale_bar: draw a scale bar, and an arrow to the north if the map has a reference system.
        label: label of the color bar; empty stands for the name of the layer, with [m] for heights.
        title: title above the picture.
        color_bar: draw a color bar, and say in a legend how cells without a value look.

    Returns:
        The axes.

    Raises:
        LayerNotFoundError: the map lacks a layer.
        ConfigError: the color map is unknown, or another option is invalid.
        GridMapError: a tiled map cannot be read.
    """
    site = opened(grid_map)
    flat = flat_of(
        site,
        layer,
        color_mode=color_mode,
        color_map=color_map,
        lower=lower,
        upper=upper,
        invert=invert,
        hillshade=hillshade,
        exaggeration=exaggeration,
        max_drawn_cells=max_drawn_cells,
        scale_bar=scale_bar,
        label=label,
        title=title,
        color_bar=color_bar,
    )
    axes = _pyplot().gca() if ax is None else ax
    bar, has_holes = flat.paint(axes, loaded(site, *flat.needs(axes, site.size)))
    flat.explain(axes, bar, has_holes=has_holes)
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
    """Draw a map as a shaded surface of triangles in three dimensions.

    Args:
        grid_map: as for `plot`.
        height_layer: heights [m]; empty stands for `elevation`, or else the first layer.
        ax: Matplotlib axes of the projection "3d"; None stands for new ones.
        color_layer: layer that gives the colors; empty stands for the heights.
        color_mode, color_map, lower, upper, invert, label, title, color_bar: as for `plot`.
        exaggeration: factor on the drawn heights. The axis shows true heights.
        max_drawn_cells: limit of the cells, to which larger maps are thinned out; 0 for no limit.
            Matplotlib draws the default number in about a second.

    Returns the axes, and raises the errors of `plot`.
    """
    check_options(color_mode, exaggeration)
    check_max_drawn_cells(max_drawn_cells)
    site = opened(grid_map)
    height_layer = height_layer or usual_layer(site)
    layer = color_layer or height_layer
    coloring = Coloring(color_mode, layer, color_map, lower, upper, invert)
    axes = _pyplot().figure().add_subplot(projection="3d") if ax is None else ax
    check(axes.name == "3d", "ax", "axes of the projection '3d'", axes.name)
    drawn_map = loaded(site, {height_layer, layer}, max_drawn_cells or math.inf)
    surface = Surface(drawn_map, height_layer, max_drawn_cells=max_drawn_cells)
    mesh = surface.mesh(coloring)
    x, y, z = (mesh.vertices + mesh.origin).T
    if len(mesh.faces):
        # With antialiasing the background shows between the triangles.
        options = {"shade": False, "linewidth": 0, "antialiased": False}
        drawn = axes.plot_trisurf(x, y, z, triangles=mesh.faces, **options)
        corners = mesh.vertices[mesh.faces] * np.array([1.0, 1.0, exaggeration])
        first, second, third = corners.transpose(1, 0, 2)
        colors = mesh.colors[mesh.faces].mean(axis=1) / 255
        drawn.set_facecolor(lit(colors, np.cross(second - first, third - first)))
    x0, x1, y0, y1 = extent_of(drawn_map)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=title)
    axes.set(xlim=(x0, x1), ylim=(y0, y1))
    height = exaggeration * float(np.ptp(z)) if z.size else 0.0
    sides = np.array([x1 - x0, y1 - y0, height])
    axes.set_box_aspect(np.maximum(sides, 0.05 * sides.max()), zoom=0.95)
    axes.view_init(elev=45.0, azim=-60.0)
    # The z axis is short, with room for few ticks.
    axes.locator_params(axis="z", nbins=3)
    bar = None
    if color_bar and color_mode == "intensity":
        colors_of = mappable(coloring, drawn_map[layer])
        look = {"label": label or titled(layer), "shrink": 0.6, "pad": 0.1}
        bar = axes.figure.colorbar(colors_of, ax=axes, **look)
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
    size: tuple[int, int] = _RELIEF_SIZE,
    label: str = "",
    title: str = "",
    color_bar: bool = True,
) -> Any:
    """Draw a map as a block of terrain in perspective, with sunlight and shadows.

    The surface is drawn at the resolution of the picture, in about a second. There are no axes:
    use `plot` or `plot_3d` to read positions and heights.

    Args:
        grid_map: as for `plot`.
        height_layer: heights [m]; empty stands for `elevation`, or else the first layer. Holes get
            the height of the nearest cell.
        ax: Matplotlib axes to draw on; None stands for the current ones.
        color_layer: layer that gives the colors; empty stands for the heights. Cells without a
            value are gray.
        color_mode, color_map, lower, upper, invert, label, title, color_bar: as for `plot`.
        exaggeration: factor on the heights. A block that is more than 20 times as high as the map
            is long is drawn that high.
        azimuth: direction from the map to the camera [rad], from +x towards +y.
        elevation: angle of the camera above the ground [rad], between 0 and pi / 3.
        size: width and height of the picture [pixels].

    Returns the axes, and raises the errors of `plot`.
    """
    check_options(color_mode, exaggeration)
    # Near pi / 2, the picture of a level camera is stretched beyond recognition.
    check(0 < elevation < math.pi / 3, "elevation", "an angle between 0 and pi / 3", elevation)
    check(math.isfinite(azimuth), "azimuth", "a finite angle", azimuth)
    check(min(size) >= 1, "size", "a width and height of at least 1 pixel", size)
    # SciPy is slow to import.
    from ._relief import MAX_SIDE, draw_relief

    site = opened(grid_map)
    height_layer = height_layer or usual_layer(site)
    layer = color_layer or height_layer
    coloring = Coloring(color_mode, layer, color_map, lower, upper, invert)
    axes = _pyplot().gca() if ax is None else ax
    cells = MAX_SIDE**2 * min(site.size) / max(site.size)
    drawn_map = loaded(site, {height_layer, layer}, cells)
    # Along +x and +y, while rows and columns run along -x and -y.
    heights, values = (drawn_map.unwrapped(name)[::-1, ::-1] for name in (height_layer, layer))
    scale = exaggeration / drawn_map.resolution
    axes.imshow(draw_relief(heights, coloring(values), size, azimuth, elevation, scale))
    axes.set_axis_off()
    axes.set_title(title)
    bar = None
    if color_bar and color_mode == "intensity":
        place = axes.inset_axes((0.02, 0.12, 0.24, 0.025))
        look = {"orientation": "horizontal", "label": label or titled(layer)}
        bar = axes.figure.colorbar(mappable(coloring, values), cax=place, **look)
    if color_bar and not np.isfinite(values).all():
        add_legend(axes, bar, _GRAY)
    return axes


def save_picture(
    grid_map: AnyMap,
    layer: str,
    path: str | PathLike[str],
    *,
    style: Literal["flat", "surface", "relief"] = "flat",
    dpi: float = 110,
    **options: Any,
) -> None:
    """Write a picture of a map to a file, which appears complete or not at all.

    Args:
        grid_map: as for `plot`.
        layer: gives the colors of a flat picture, else the heights; empty stands for `elevation`,
            or else the first.
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


def save_animation(
    records: Sequence[MapRecord],
    layer: str,
    path: str | PathLike[str],
    *,
    speed: float = 1.0,
    dpi: float = 110,
    progress: Callable[[int, int], Any] | None = None,
    **options: Any,
) -> None:
    """Write the maps of a bag as a video or an animated GIF, each drawn as `plot` does.

    All frames show the same rectangle, which covers all maps, and the same range of values, so that
    moved maps and changed values can be seen. The title has the time since the first map. The maps
    are read twice, one after the other: first for the rectangle and the range, then to draw them.
    The frame rate is constant, that of the median interval between maps; of more than 50 frames per
    second, every n-th map is drawn.

    Args:
        records: maps in the order of time, such as a `BagReader`.
        layer: gives the colors; empty stands for `elevation`, or else the first.
        path: the file, whose ending decides its format: .gif or .mp4. An existing one is replaced.
        speed: factor on the speed of the recording.
        dpi: pixels per inch.
        progress: is called after each map that is read or drawn, with the number of finished maps
            and of all.
        options: those of `plot`, except `ax`.

    Raises:
        LayerNotFoundError: a map lacks a layer.
        ConfigError: there are no maps, the name has another ending, or an option is invalid.
        MissingPackageError: for .mp4, there is neither `ffmpeg` nor the package imageio-ffmpeg.
        OSError: the file cannot be written.
    """
    from ._animation import animate, check_path

    check_path(path)
    check(math.isfinite(speed) and speed > 0, "speed", "a positive number", speed)
    check(len(records) > 0, "records", "maps", "none")
    with new_file(path) as temporary:
        ending = Path(path).suffix.lower()
        animate(records, layer, temporary, ending, speed, dpi, progress or _ignore, options)


def _ignore(finished: int, total: int) -> None:
    """Show no progress."""


def _pyplot() -> Any:
    # Imported late, because the import looks for a display.
    from matplotlib import pyplot

    return pyplot
