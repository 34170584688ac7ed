# SPDX-License-Identifier: BSD-3-Clause
"""Maps of a recording as a video or an animated GIF, of which one frame is in memory."""

import math
import shutil
import subprocess
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter
from matplotlib.figure import Figure
from PIL import GifImagePlugin, Image

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import max_of_finites, min_of_finites
from grid_map_core_py.errors import MissingPackageError
from grid_map_core_py.files import MapRecord
from grid_map_core_py.plugins import check

from ._flat import Extent, extent_of, flat_of

ENDINGS = (".gif", ".mp4")

_MOST_FRAMES = 50.0
"""Frames per second; browsers slow faster GIF files down."""

_REMEDY = "install ffmpeg (apt) or imageio-ffmpeg (pip), or write a .gif file, which needs neither"


class _Survey(NamedTuple):
    """Facts of all maps of a recording."""

    times: list[int]
    lower: float
    upper: float
    view: Extent
    has_holes: bool


def check_path(path: str | PathLike[str]) -> None:
    """Raise the errors of `save_animation` about the name, or the program that writes the file."""
    expected = f"a name that ends in {' or '.join(ENDINGS)}"
    ending = Path(path).suffix.lower()
    check(ending in ENDINGS, "path", expected, Path(path).name)
    if ending == ".mp4":
        _ffmpeg()


def animate(
    records: Sequence[MapRecord],
    layer: str,
    path: Path,
    ending: str,
    speed: float,
    dpi: float,
    progress: Callable[[int, int], Any],
    options: dict[str, Any],
) -> None:
    """Write an animation; see `save_animation`."""
    flat = flat_of(records[0].grid_map(), layer, **options)
    survey = _surveyed(records, flat.coloring.layer, lambda: progress(0, len(records)))
    bounds = {"lower": survey.lower, "upper": survey.upper} | {
        name: bound for name in ("lower", "upper") if (bound := options.get(name)) is not None
    }
    # Bounds that are equal, or missing, are those of each map.
    if bounds["lower"] < bounds["upper"]:
        options = options | bounds
    flat = flat_of(records[0].grid_map(), layer, **options)
    every, rate = _rate(survey.times, speed)
    writer = _writer(ending, rate)
    figure = Figure(figsize=(9.0, 7.0), dpi=dpi, layout="constrained")
    axes = figure.add_subplot()
    begin = survey.times[0]
    with _Written(writer, figure, path, dpi):
        for number in range(0, len(records), every):
            record = records[number]
            axes.clear()
            bar, _ = flat.paint(axes, record.grid_map(flat.layers), survey.view)
            text = f"{(record.time - begin) / 1e9:.2f} s"
            axes.set_title(f"{flat.title}, {text}" if flat.title else text)
            if number == 0:
                flat.explain(axes, bar, has_holes=survey.has_holes)
                # The next frames have the same layout.
                figure.draw_without_rendering()
                figure.set_layout_engine("none")
            writer.grab_frame()
            progress(min(number + every, len(records)), len(records))


def _surveyed(records: Sequence[MapRecord], layer: str, progress: Callable[[], Any]) -> _Survey:
    times, ranges, extents, has_holes = [], [], [], False
    for record in records:
        grid_map: GridMap = record.grid_map([layer])
        values = grid_map[layer]
        times.append(record.time)
        ranges.append((min_of_finites(values), max_of_finites(values)))
        extents.append(extent_of(grid_map))
        has_holes = has_holes or not np.isfinite(values).all()
        progress()
    lowest, highest = np.array(ranges, np.float32).T
    left, right, bottom, top = np.transpose(extents)
    view = float(left.min()), float(right.max()), float(bottom.min()), float(top.max())
    return _Survey(times, min_of_finites(lowest), max_of_finites(highest), view, has_holes)


def _rate(times: Sequence[int], speed: float) -> tuple[int, float]:
    """Return every which map becomes a frame, and how many frames a second has."""
    steps = np.diff(times) / 1e9
    steps = steps[steps > 0]
    rate = speed / float(np.median(steps)) if steps.size else 1.0
    every = math.ceil(rate / _MOST_FRAMES)
    return every, rate / every


def _writer(ending: str, rate: Any) -> AbstractMovieWriter:
    if ending == ".gif":
        return _GifWriter(fps=rate)
    # The temporary name of the file does not tell its format.
    return _VideoWriter(fps=rate, codec="h264", extra_args=["-f", "mp4"])


def _ffmpeg() -> str:
    """Return the program that writes videos.

    Raises:
        MissingPackageError: it is not installed.
    """
    if found := shutil.which("ffmpeg"):
        return found
    try:
        return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError) as error:
        raise MissingPackageError("ffmpeg", "a video", _REMEDY) from error


class _Written:
    """Begins and finishes a file; after an error it ends the writer, and the error stays."""

    def __init__(self, writer: AbstractMovieWriter, figure: Figure, path: Path, dpi: float) -> None:
        self._writer = writer
        writer.setup(figure, str(path), dpi)

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._finish()
        else:
            with suppress(OSError):
                self._finish()

    def _finish(self) -> None:
        try:
            self._writer.finish()
        except subprocess.CalledProcessError as error:
            text = str(error.stderr or error.stdout or error).strip().splitlines()
            raise OSError(f"ffmpeg: {text[-1] if text else error}") from error


class _VideoWriter(FFMpegWriter):
    """Finds the program in the package imageio-ffmpeg, too."""

    @classmethod
    def bin_path(cls) -> str:
        return _ffmpeg()


class _GifWriter(AbstractMovieWriter):
    """Writes each frame when it comes; `PillowWriter` holds all of them."""

    def setup(self, fig: Any, outfile: Any, dpi: float | None = None) -> None:
        super().setup(fig, outfile, dpi)
        self._file = Path(outfile).open("wb")  # noqa: SIM115
        self._is_begun = False

    def grab_frame(self, **savefig_kwargs: Any) -> None:
        pixels = BytesIO()
        self.fig.savefig(pixels, format="rgba", dpi=self.dpi, **savefig_kwargs)
        frame = Image.frombytes("RGBA", self.frame_size, pixels.getbuffer())
        frame = frame.convert("RGB").quantize(
            256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
        )
        if not self._is_begun:
            self._file.writelines(GifImagePlugin.getheader(frame, info={"loop": 0})[0])
            self._is_begun = True
        times: dict[str, Any] = {"duration": round(1000 / self.fps), "include_color_table": True}
        self._file.writelines(GifImagePlugin.getdata(frame, **times))

    def finish(self) -> None:
        with self._file:
            self._file.write(b";")
