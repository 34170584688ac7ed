# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map plot`: a picture of a map."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import (
    add_choice_of_map,
    add_source,
    complete_color_maps,
    complete_layers,
    completed,
)
from .errors import CommandError, UsageError
from .formats import check_free
from .output import message

if TYPE_CHECKING:
    from grid_map_core_py import GridMap

HELP = "draw a map from above or in 3-D to a PNG, PDF or SVG file"

ENDINGS = (".png", ".pdf", ".svg")

LARGEST_DPI = 1200
"""Which takes half a gigabyte."""

_SIZE = (9.0, 7.0)
_ONLY_FLAT, _ONLY_THREE_D = ("shade_by",), ("color_layer", "max_cells")
"""Options that one kind of picture has alone."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what `run` needs."""
    add_source(parser)
    parser.add_argument("picture", type=Path, help=f"file that ends in {', '.join(ENDINGS)}")
    _add_layer(parser, "--layer", "what is shown, in 3-D the heights (elevation, or the first)")
    parser.add_argument("-f", "--force", action="store_true", help="replace what is there")
    add_choice_of_map(parser)
    parser.add_argument("--3d", "--three-d", dest="three_d", action="store_true", help="a surface")
    _add_layer(parser, "--color-layer", "3-D: what gives the colours (the heights)")
    parser.add_argument("--max-cells", type=int, help="3-D: thin out larger maps; 0 for never")
    _add_layer(parser, "--shade-by", "not 3-D: heights that the light falls on (no light)")
    parser.add_argument("--exaggeration", type=float, default=1.0, help="factor on the heights (1)")
    colors = parser.add_argument_group("colours")
    colors.add_argument(
        "--color-mode",
        choices=("intensity", "color"),
        help="color: packed ones (for layers whose name ends in color)",
    )
    completed(
        colors.add_argument("--color-map", default="viridis", help="of Matplotlib (%(default)s)"),
        complete_color_maps,
    )
    colors.add_argument("--lower", type=float, help="value at the lower end (the smallest)")
    colors.add_argument("--upper", type=float, help="value at the upper end (the largest)")
    colors.add_argument("--invert", action="store_true", help="swap the ends of the colour map")
    texts = parser.add_argument_group("picture")
    texts.add_argument("--label", default="", help="of the colour bar (the name of the layer)")
    texts.add_argument("--title", help="above the picture (layer and frame)")
    texts.add_argument("--dpi", type=float, default=110.0, help="pixels per inch (110)")


def _add_layer(parser: argparse.ArgumentParser, name: str, text: str) -> None:
    completed(parser.add_argument(name, metavar="LAYER", help=text), complete_layers)


def run(options: argparse.Namespace) -> int:
    """Draw, and say where."""
    _check(options)
    from .reading import read_map

    shown = {options.layer, options.color_layer, options.shade_by} - {None}
    layers = shown if options.layer else None
    _draw(read_map(options.source, options.topic, options.index, layers), options)
    message(f"{options.picture} is drawn")
    return 0


def _check(options: argparse.Namespace) -> None:
    """Refuse at once what would be refused in the end."""
    if options.picture.suffix.lower() not in ENDINGS:
        known = ", ".join(ENDINGS)
        raise UsageError(f"{options.picture}: expected a name that ends in {known}")
    for name in _ONLY_FLAT if options.three_d else _ONLY_THREE_D:
        if getattr(options, name) is not None:
            kind = "without" if options.three_d else "with"
            raise UsageError(f"--{name.replace('_', '-')} goes {kind} --3d only")
    if not 1 <= options.dpi <= LARGEST_DPI:
        raise UsageError(f"--dpi: expected a number from 1 to {LARGEST_DPI}, got {options.dpi:g}")
    check_free(str(options.picture), force=options.force)


def _draw(grid_map: "GridMap", options: argparse.Namespace) -> None:
    from grid_map_core_py.files import new_file, storage_errors
    from grid_map_visualization_py.pictures import plot, plot_3d

    layer = _layer(grid_map, options.layer)
    title = f"{layer} in {grid_map.frame_id!r}" if options.title is None else options.title
    style = _style(options, layer) | {"title": title}
    # Behind `pictures`, which says what to install where Matplotlib is missing.
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE, dpi=options.dpi, layout="constrained")
    if options.three_d:
        plot_3d(grid_map, layer, figure.add_subplot(projection="3d"), **style)
    else:
        plot(grid_map, layer, figure.add_subplot(), **style)
    with storage_errors(options.picture, "written"), new_file(options.picture) as temporary:
        figure.savefig(temporary, format=options.picture.suffix[1:].lower())


def _layer(grid_map: "GridMap", wanted: str | None) -> str:
    from grid_map_visualization_py.viewer.settings import follow

    if wanted is not None:
        grid_map[wanted]  # raises where there is none
        return wanted
    if not grid_map.layers:
        raise CommandError("the map has no layers")
    return follow("elevation", grid_map.layers)


def _style(options: argparse.Namespace, layer: str) -> dict[str, Any]:
    """Return the options of `plot` or `plot_3d` that were given."""
    names = (
        *("color_layer", "max_cells", "shade_by", "exaggeration"),
        *("color_mode", "color_map", "lower", "upper", "invert", "label"),
    )
    style = {name: getattr(options, name) for name in names}
    if (options.color_layer or layer).endswith("color") and not options.color_mode:
        style["color_mode"] = "color"
    return {name: value for name, value in style.items() if value is not None}
