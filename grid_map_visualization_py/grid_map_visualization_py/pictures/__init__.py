# SPDX-License-Identifier: BSD-3-Clause
"""Draw pictures of maps with Matplotlib.

`plot` draws a map from above as in RViz: x to the right and y upwards [m], in the map frame.
`plot_3d` draws a surface, and `plot_relief` draws a block of terrain in perspective. The functions
accept a `GridMap`, a `TiledMap`, or an xarray dataset or array. Large tiled maps are read at the
resolution of the picture.

In `plot` and `plot_3d`, the light for hillshading comes from the upper left, 45 degrees above the
horizon. Level ground keeps its color; slopes are lighter if they face the light, and darker
otherwise.
"""

import math
import shutil
from collections.abc import Callable, Sequence
from importlib import import_module
from io import BytesIO
from os import PathLike
from pathlib import Path
from subprocess import CalledProcessError
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from grid_map_core_py import _lazy
from grid_map_core_py._arrays import max_of_finites, min_of_finites
from grid_map_core_py.errors import MissingPackageError
from grid_map_core_py.files._formats import MapRecord
from grid_map_core_py.files._shared import new_file
from grid_map_core_py.plugins import check

from .._layers import lit_heights, usual_layer

try:
    from matplotlib import rc_context
    from matplotlib.animation import FFMpegWriter, PillowWriter
    from matplotlib.figure import Figure

    from ._from_above import extent_of
    from ._plots import RELIEF_SIZE, plot as plot, plot_3d as plot_3d, plot_relief as plot_relief
except ImportError as error:
    raise MissingPackageError("matplotlib", "a picture") from error

__all__, __dir__ = _lazy.public_names(
    ["plot", "plot_3d", "plot_relief", "save_animation", "save_picture"]
)

_LONGEST_FRAME = 655.0
"""Longest duration of a frame of a GIF file [s]."""

_MOST_FRAMES = 50.0
"""Maximum frame rate [1/s]; browsers slow down faster GIF files."""


def save_picture(
    grid_map: Any,
    layer: str,
    path: str | PathLike[str],
    *,
    style: Literal["flat", "surface", "relief"] = "flat",
    dpi: float = 110,
    **options: Any,
) -> None:
    """Write a picture of a map to a file.

    The file is written completely or not at all.

    Args:
        grid_map: as for `plot`.
        layer: layer with the colors (style "flat") or the heights (other styles); empty means
            `elevation`, or else the first layer.
        path: path of the file; an existing file is replaced. The extension selects the format:
            .jpeg, .jpg, .pdf, .png or .svg.
        style: "flat" uses `plot`, "surface" uses `plot_3d`, and "relief" uses `plot_relief`.
        dpi: pixels per inch.
        options: keyword arguments of the selected function, except `ax`.

    Raises:
        LayerNotFoundError: the map lacks a layer.
        ConfigError: the color map, the file extension or another option is invalid.
        OSError: the file cannot be written.
    """
    styles = ("flat", "surface", "relief")
    check(style in styles, "style", f"one of {', '.join(styles)}", style)
    ending = _ending_of(path, ".jpeg", ".jpg", ".pdf", ".png", ".svg")
    figure = Figure(figsize=(9.0, 7.0), dpi=dpi, layout="constrained")
    if style == "flat":
        plot(grid_map, layer, figure.add_subplot(), **options)
    elif style == "surface":
        plot_3d(grid_map, layer, figure.add_subplot(projection="3d"), **options)
    else:
        # Draw the relief at the resolution of the picture.
        figure.set_layout_engine("none")
        width, height = options.get("size", RELIEF_SIZE)
        figure.set_size_inches(width / dpi, height / dpi)
        top = 0.93 if options.get("title") else 1.0
        plot_relief(grid_map, layer, figure.add_axes((0.0, 0.0, 1.0, top)), **options)
    # Draw to memory first: on a full disk, Matplotlib raises misleading errors for PDF files.
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
    progress: Callable[[int, int], Any] = lambda *_: None,
    **options: Any,
) -> None:
    """Write recorded maps to a video or an animated GIF; each frame is drawn with `plot`.

    All frames show the same area and the same value range, so that motion and changed values are
    visible. Therefore, all maps are read once before the frames are drawn. The title shows the time
    since the first map.

    The frame rate is constant. It follows from the median interval between maps. Above 50 frames
    per second, only every n-th map is drawn. The frames of a GIF are kept in memory until the end.

    Args:
        records: maps in time order, such as a `BagReader`.
        layer: layer with the colors; empty means `elevation`, or else the first layer.
        path: path of the .gif or .mp4 file; an existing file is replaced.
        speed: playback speed relative to the recording.
        dpi: pixels per inch.
        progress: called after each map with the number of drawn maps and the number of all maps.
            The number of drawn maps stays 0 while the maps are first read.
        options: keyword arguments of `plot`, except `ax`.

    Raises:
        LayerNotFoundError: a map lacks a layer.
        ConfigError: there are no maps, or the file extension or an option is invalid.
        MissingPackageError: for .mp4, neither `ffmpeg` nor imageio-ffmpeg is installed.
        OSError: the file cannot be written.
    """
    ending = _ending_of(path, ".gif", ".mp4")
    program = shutil.which("ffmpeg") or ""
    if ending == ".mp4" and not program:
        try:
            program = str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
        except (ImportError, RuntimeError) as error:
            remedy = "install ffmpeg (apt) or imageio-ffmpeg (pip), or write a .gif file instead"
            raise MissingPackageError("ffmpeg", "a video", remedy) from error
    check(math.isfinite(speed) and speed > 0, "speed", "a positive number", speed)
    check(len(records) > 0, "records", "maps", "none")
    with new_file(path) as temporary, TemporaryDirectory() as folder:
        # Writers derive the format from the file name.
        file = Path(folder) / f"animation{ending}"
        try:
            with rc_context({"animation.ffmpeg_path": program}):
                _animate(records, layer, file, speed, dpi, progress, options)
        except CalledProcessError as error:
            text = str(error.stderr or error.stdout or error).strip()
            raise OSError(f"ffmpeg: {text.splitlines()[-1]}") from error
        shutil.copyfile(file, temporary)


def _animate(
    records: Sequence[MapRecord],
    layer: str,
    file: Path,
    speed: float,
    dpi: float,
    progress: Callable[[int, int], Any],
    options: dict[str, Any],
) -> None:
    count = len(records)
    first = records[0].grid_map()
    layer = layer or usual_layer(first)
    layers = {layer, lit_heights(first, layer, options.get("hillshade"))} - {""}
    times, ranges, extents, with_hole = [], [], [], 0
    for number, record in enumerate(records):
        grid_map = record.grid_map([layer])
        values = grid_map[layer]
        times.append(record.time)
        ranges.append((min_of_finites(values), max_of_finites(values)))
        extents.append(extent_of(grid_map))
        if not with_hole and not np.isfinite(values).all():
            with_hole = number
        progress(0, count)
    lowest, highest = np.array(ranges, np.float32).T
    left, right, bottom, top = np.transpose(extents)
    view = {"xlim": (left.min(), right.max()), "ylim": (bottom.min(), top.max())}
    bounds = {"lower": min_of_finites(lowest), "upper": max_of_finites(highest)}
    bounds |= {name: options[name] for name in bounds if options.get(name) is not None}
    # If the bounds are equal or missing, each map uses its own bounds.
    if bounds["lower"] < bounds["upper"]:
        options = options | bounds
    title = options.pop("title", "")
    steps = np.diff(times) / 1e9
    steps = steps[steps > 0]
    rate: Any = speed / float(np.median(steps)) if steps.size else 1.0
    every = math.ceil(rate / _MOST_FRAMES)
    least = speed / (rate * _LONGEST_FRAME)
    expected = f"at least {least:.3g}: a frame of a GIF file lasts at most {_LONGEST_FRAME:g} s"
    check(file.suffix != ".gif" or speed >= least, "speed", expected, speed)
    writer: Any = PillowWriter(rate / every)
    if file.suffix == ".mp4":
        writer = FFMpegWriter(rate / every, codec="h264")
    figure = Figure(figsize=(9.0, 7.0), dpi=dpi, layout="constrained")
    axes = figure.add_subplot()
    # All frames keep the layout and legend of this plot, so it preferably shows a map with a hole.
    plot(records[with_hole].grid_map(layers), layer, axes, **options, title=title or " ")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    options["color_bar"] = False
    with writer.saving(figure, str(file), dpi):
        for number in range(0, count, every):
            axes.clear()
            plot(records[number].grid_map(layers), layer, axes, **options)
            text = f"{(times[number] - times[0]) / 1e9:.2f} s"
            axes.set(title=f"{title}, {text}" if title else text, **view)
            writer.grab_frame()
            progress(min(number + every, count), count)


def _ending_of(path: str | PathLike[str], *endings: str) -> str:
    ending = Path(path).suffix.lower()
    before, last = ", ".join(endings[:-1]), endings[-1]
    expected = f"a name that ends in {before} or {last}"
    check(ending in endings, "path", expected, Path(path).name)
    return ending
