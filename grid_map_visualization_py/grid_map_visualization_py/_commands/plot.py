# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Draw a map from above, as a surface or as terrain in relief to a PNG, JPEG, PDF or SVG file."""

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grid_map_core_py.commands import (
    CommandError,
    UsageError,
    add_source,
    check_free,
    complete_layers,
    completed,
    message,
    read_map,
    tiled_source,
)

if TYPE_CHECKING:
    from grid_map_core_py import GridMap
    from grid_map_core_py.tiled import TiledMap

_SIDE = 2000
"""Rows and columns that are drawn of a map that is too large for memory."""

ENDINGS = (".jpg", ".pdf", ".png", ".svg")

_STYLES_OF = {
    "shade_by": (("flat",), "without --3d and --relief"),
    "color_layer": (("surface", "relief"), "with --3d or --relief"),
    "max_drawn_cells": (("surface",), "with --3d"),
}
"""Options that not all styles have."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `run` to a parser."""
    add_source(parser)
    parser.add_argument("picture", type=Path, help=f"file that ends in {', '.join(ENDINGS)}")
    parser.add_argument("-f", "--force", action="store_true", help="replace existing files")
    add_style(parser)


def add_style(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say how to draw a map."""
    picture = parser.add_argument_group("picture")
    add, add_layer = picture.add_argument, partial(picture.add_argument, metavar="LAYER")
    text = "what is drawn, the heights if not flat (elevation, or the first)"
    completed(add_layer("--layer", help=text), complete_layers)
    styles = picture.add_mutually_exclusive_group()
    add_flag = partial(styles.add_argument, dest="style", action="store_const")
    add_flag("--3d", "--three-d", const="surface", help="draw a surface with axes")
    text = "draw terrain in perspective, with light and shadows"
    add_flag("--relief", const="relief", help=text)
    text = "not flat: layer that gives the colors (the heights)"
    completed(add_layer("--color-layer", help=text), complete_layers)
    add("--max-drawn-cells", type=int, help="3-D: thin out larger maps; 0 for never")
    text = "flat: heights that the light falls on (no light)"
    completed(add_layer("--shade-by", help=text), complete_layers)
    add("--exaggeration", type=float, help="factor that scales the heights (1)")
    add("--title", help="text above the picture (layer and frame)")
    add("--dpi", type=float, default=110.0, help="pixels per inch (110)")
    add = parser.add_argument_group("colors").add_argument
    text = "color: packed colors (for layers whose name ends in color)"
    add("--color-mode", choices=("intensity", "color"), help=text)
    completed(add("--color-map", help="color map of Matplotlib (viridis)"), complete_color_maps)
    add("--lower", type=float, help="value at the lower end (the smallest)")
    add("--upper", type=float, help="value at the upper end (the largest)")
    text = "swap the ends of the color map"
    add("--invert", action="store_const", const=True, help=text)
    add("--label", help="label of the color bar (name of the layer)")


def complete_color_maps(**_: Any) -> list[str]:
    """Return the names of color maps, for completion in a shell."""
    try:
        from ..colors import color_map_names

        return color_map_names()
    except Exception:
        return []


def run(options: argparse.Namespace) -> int:
    """Draw, and tell where the picture is."""
    check_style(options, options.picture)
    check_free(str(options.picture), force=options.force)
    shown = {options.layer, options.color_layer, options.shade_by} - {None}
    draw(_read(options, shown if options.layer else None), options, options.picture)
    message(f"{options.picture} is drawn")
    return 0


def _read(options: argparse.Namespace, layers: set[str] | None) -> "GridMap":
    """Return the map; of one that is too large for memory, every n-th cell."""
    site = tiled_source(options)
    if site is None:
        return read_map(options, layers)
    if layers is None:
        layers = {usual_layer(site)}
    grid_map = site.thinned(-(-max(site.size) // _SIDE), layers)
    step = round(grid_map.resolution / site.resolution)
    message(f"one of {step} x {step} cells is drawn")
    return grid_map


def check_style(options: argparse.Namespace, picture: Path) -> None:
    """Raise `UsageError` if the name or an argument of `add_style` makes no sense."""
    if picture.suffix.lower() not in ENDINGS:
        raise UsageError(f"{picture}: expected a name that ends in {', '.join(ENDINGS)}")
    for name, (styles, when) in _STYLES_OF.items():
        if getattr(options, name) is not None and (options.style or "flat") not in styles:
            raise UsageError(f"--{name.replace('_', '-')} goes {when} only")
    # A picture of 1200 pixels per inch takes half a gigabyte.
    if not 1 <= options.dpi <= 1200:
        raise UsageError(f"--dpi: expected a number from 1 to 1200, got {options.dpi:g}")


def usual_layer(grid_map: "GridMap | TiledMap") -> str:
    """Return the layer that is drawn unless the user names one: elevation, or the first."""
    if not grid_map.layers:
        raise CommandError("the map has no layers")
    return "elevation" if "elevation" in grid_map.layers else grid_map.layers[0]


def draw(grid_map: "GridMap", options: argparse.Namespace, picture: Path) -> None:
    """Draw a map as the arguments of `add_style` say, or raise `GridMapError`."""
    # Slow to import.
    from grid_map_core_py.files import storage_errors

    from ..pictures import save_picture

    layer = options.layer or usual_layer(grid_map)
    names = (
        *("style", "color_layer", "max_drawn_cells", "shade_by", "exaggeration", "dpi"),
        *("color_mode", "color_map", "lower", "upper", "invert", "label", "title"),
    )
    given = {name: value for name, value in vars(options).items() if value is not None}
    style = {name: given[name] for name in names if name in given}
    style.setdefault("title", f"{layer} in {grid_map.frame_id!r}")
    if (options.color_layer or layer).endswith("color"):
        style.setdefault("color_mode", "color")
    try:
        save_picture(grid_map, layer, picture, **style)
    except OSError:
        with storage_errors(picture, "written"):
            raise
