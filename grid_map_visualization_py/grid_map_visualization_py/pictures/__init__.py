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

from grid_map_core_py._arrays import max_of_finites, min_of_finites
from grid_map_core_py._files import MapRecord, new_file
from grid_map_core_py.errors import MissingPackageError
from grid_map_core_py.plugins import check

from .._layers import lit_heights, usual_layer
from ..colors import REMEDY

try:
    from matplotlib import rc_context
    from matplotlib.animation import FFMpegWriter, PillowWriter
    from matplotlib.figure import Figure

    from ._from_above import extent_of
    from ._plots import RELIEF_SIZE, plot, plot_3d, plot_relief
except ImportError as error:
    raise MissingPackageError("matplotlib", "a picture", REMEDY) from error

__all__ = ["plot", "plot_3d", "plot_relief", "save_animation", "save_picture"]

_MOST_FRAMES = 50.0
"""Frames per second; browsers slow faster GIF files down."""


def save_picture(
    grid_map: Any,
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
    styles = ("flat", "surface", "relief")
    check(style in styles, "style", f"one of {', '.join(styles)}", style)
    ending = _ending_of(path, ".jpeg", ".jpg", ".pdf", ".png", ".svg")
    figure = Figure(figsize=(9.0, 7.0), dpi=dpi, layout="constrained")
    if style == "flat":
        plot(grid_map, layer, figure.add_subplot(), **options)
    elif style == "surface":
        plot_3d(grid_map, layer, figure.add_subplot(projection="3d"), **options)
    else:
        # One pixel of the relief per pixel of the picture.
        figure.set_layout_engine("none")
        width, height = options.get("size", RELIEF_SIZE)
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
    progress: Callable[[int, int], Any] = lambda *_: None,
    **options: Any,
) -> None:
    """Write the maps of a bag as a video or an animated GIF, each drawn as `plot` does.

    All frames show the same rectangle, which covers all maps, and the same range of values, so that
    moved maps and changed values can be seen. The title has the time since the first map. The maps
    are read twice, one after the other: first for the rectangle and the range, then to draw them.
    The frame rate is constant, that of the median interval between maps; of more than 50 frames per
    second, every n-th map is drawn. All frames of a GIF are in memory.

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
        # Writers tell the format from the name of the file.
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
    # Bounds that are equal, or missing, are those of each map.
    if bounds["lower"] < bounds["upper"]:
        options = options | bounds
    title = options.pop("title", "")
    steps = np.diff(times) / 1e9
    steps = steps[steps > 0]
    rate: Any = speed / float(np.median(steps)) if steps.size else 1.0
    every = math.ceil(rate / _MOST_FRAMES)
    writer: Any = PillowWriter(rate / every)
    if file.suffix == ".mp4":
        writer = FFMpegWriter(rate / every, codec="h264")
    figure = Figure(figsize=(9.0, 7.0), dpi=dpi, layout="constrained")
    axes = figure.add_subplot()
    # All frames have the layout and the legend of a map with a hole.
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
