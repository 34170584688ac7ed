# SPDX-License-Identifier: BSD-3-Clause
"""Draw a map to a PNG, JPEG, PDF or SVG file, or the maps of a bag to an MP4 or GIF video."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grid_map_core_py._commands import (
    CommandError,
    ProgressBar,
    UsageError,
    add_source,
    check_free,
    complete_layers,
    completed,
    message,
    open_recording,
    read_map,
    tiled_source,
)

from .._layers import usual_layer as usual_layer

if TYPE_CHECKING:
    from grid_map_core_py import GridMap
    from grid_map_core_py.tiled import TiledMap

ENDINGS = (".jpg", ".pdf", ".png", ".svg")
_ANIMATED = (".gif", ".mp4")

_STYLES_OF = {
    "hillshade": (("flat",), "without --3d and --relief"),
    "color_layer": (("surface", "relief"), "with --3d or --relief"),
    "max_drawn_cells": (("flat", "surface"), "without --relief"),
}
"""Options that only some styles accept: these styles, and their names in error messages."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_source(parser)
    text = f"output file ({', '.join(ENDINGS + _ANIMATED)}); the last two show all maps of a bag"
    parser.add_argument("picture", type=Path, help=text)
    parser.add_argument("-f", "--force", action="store_true", help="replace existing files")
    text = ".mp4, .gif: playback speed relative to the recording (1)"
    parser.add_argument("--speed", type=float, help=text)
    add_style(parser)


def add_style(parser: argparse.ArgumentParser) -> None:
    picture = parser.add_argument_group("picture")
    add, add_layer = picture.add_argument, partial(picture.add_argument, metavar="LAYER")
    text = "layer to draw; the heights with --3d or --relief (elevation, or the first)"
    completed(add_layer("--layer", help=text), complete_layers)
    styles = picture.add_mutually_exclusive_group()
    add_flag = partial(styles.add_argument, dest="style", action="store_const")
    add_flag("--3d", "--three-d", const="surface", help="draw a surface with axes")
    text = "draw terrain in perspective, with light and shadows"
    add_flag("--relief", const="relief", help=text)
    text = "with --3d or --relief: layer with the colors (the heights)"
    completed(add_layer("--color-layer", help=text), complete_layers)
    text = "maximum cell count; larger maps are reduced (pixels, 20000 for 3-D); 0 for none"
    add("--max-drawn-cells", type=int, metavar="CELLS", help=text)
    light = picture.add_mutually_exclusive_group()
    text = "flat: height layer for hillshading (the layer, if its name indicates heights)"
    completed(light.add_argument("--hillshade", metavar="LAYER", help=text), complete_layers)
    dark = partial(light.add_argument, "--no-hillshade", dest="hillshade", default=None)
    dark(action="store_const", const=False, help="flat: no hillshading")
    add("--exaggeration", type=float, help="factor that scales the heights (1)")
    add("--title", help="text above the picture (layer and frame)")
    add("--dpi", type=float, default=110.0, help="pixels per inch (110)")
    add = parser.add_argument_group("colors").add_argument
    text = "color: packed colors (for layers whose name ends in color)"
    add("--color-mode", choices=("intensity", "color"), help=text)
    completed(add("--color-map", help="Matplotlib color map (viridis)"), complete_color_maps)
    add("--lower", type=float, help="value at the lower end (the smallest)")
    add("--upper", type=float, help="value at the upper end (the largest)")
    text = "reverse the color map"
    add("--invert", action="store_const", const=True, help=text)
    add("--label", help="color bar label (layer name)")


def complete_color_maps(**_: Any) -> list[str]:
    try:
        from ..colors import color_map_names

        return color_map_names()
    except Exception:
        return []


def run(options: argparse.Namespace) -> int:
    is_animated = options.picture.suffix.lower() in _ANIMATED
    check_style(options, options.picture, ENDINGS + _ANIMATED)
    if is_animated and options.style:
        raise UsageError("--3d and --relief are for pictures, not for .gif and .mp4")
    if is_animated and options.index is not None:
        raise UsageError("--index is for pictures; .gif and .mp4 show all maps of a bag")
    if options.speed is not None and not is_animated:
        raise UsageError(f"--speed is for {' and '.join(_ANIMATED)}")
    check_free(str(options.picture), force=options.force)
    if is_animated:
        _animate(options)
    else:
        draw(_read(options), options, options.picture)
    message(f"{options.picture} is drawn")
    return 0


def _read(options: argparse.Namespace) -> "GridMap | TiledMap":
    """Open the map as a tiled map if possible, so that only the drawn parts are read."""
    # Without Dask, only maps that are too large for memory are opened as tiled maps.
    tiled_map = tiled_source(options, also_small=find_spec("dask") is not None)
    if tiled_map is not None:
        return tiled_map
    shown = {options.layer, options.color_layer, options.hillshade} - {None, False}
    return read_map(options, shown if options.layer else None)


def _animate(options: argparse.Namespace) -> None:
    from ..pictures import save_animation

    with ExitStack() as stack, open_recording(options) as records, _telling(options.picture):
        # Start the progress bar at the first map, to show no empty bar before an early error.
        start = cache(lambda: stack.enter_context(ProgressBar()))
        progress = lambda done, total: start()(done, total)  # noqa: E731
        if not len(records):
            raise CommandError(f"{options.source}: holds no maps")
        first = records[0].grid_map()
        layer = options.layer or usual_layer(first)
        style = _options_of(first, layer, options)
        speed = {} if options.speed is None else {"speed": options.speed}
        save_animation(records, layer, options.picture, progress=progress, **speed, **style)


def check_style(
    options: argparse.Namespace, picture: Path, endings: Sequence[str] = ENDINGS
) -> None:
    """Raise `UsageError` if the file name or an argument of `add_style` is invalid."""
    if picture.suffix.lower() not in endings:
        raise UsageError(f"{picture}: expected a name that ends in {', '.join(endings)}")
    for name, (styles, when) in _STYLES_OF.items():
        if getattr(options, name) is not None and (options.style or "flat") not in styles:
            raise UsageError(f"--{name.replace('_', '-')} goes {when} only")
    # At 1200 pixels per inch, a picture needs 0.5 GB of memory; below 10, text is illegible.
    if not 10 <= options.dpi <= 1200:
        raise UsageError(f"--dpi: expected a number from 10 to 1200, got {options.dpi:g}")


def draw(grid_map: "GridMap | TiledMap", options: argparse.Namespace, picture: Path) -> None:
    """Draw a map to a file with the arguments of `add_style`; raise `GridMapError` on failure."""
    # Imported here, because the import is slow.
    from ..pictures import save_picture

    layer = options.layer or usual_layer(grid_map)
    with _telling(picture):
        save_picture(grid_map, layer, picture, **_options_of(grid_map, layer, options))


def _options_of(
    grid_map: "GridMap | TiledMap", layer: str, options: argparse.Namespace
) -> dict[str, Any]:
    """Convert the arguments of `add_style` to keyword arguments of `save_picture`."""
    names = (
        *("style", "color_layer", "max_drawn_cells", "hillshade", "exaggeration", "dpi"),
        *("color_mode", "color_map", "lower", "upper", "invert", "label", "title"),
    )
    given = {name: value for name, value in vars(options).items() if value is not None}
    style = {name: given[name] for name in names if name in given}
    frame = f" in {grid_map.frame_id!r}" if grid_map.frame_id else ""
    style.setdefault("title", layer + frame)
    if (options.color_layer or layer).endswith("color"):
        style.setdefault("color_mode", "color")
    return style


@contextmanager
def _telling(picture: Path) -> Iterator[None]:
    """Convert write errors in the context to errors that name the picture."""
    from grid_map_core_py.files._shared import storage_errors

    try:
        yield
    except OSError:
        with storage_errors(picture, "written"):
            raise
