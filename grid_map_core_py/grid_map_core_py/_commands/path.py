# SPDX-License-Identifier: BSD-3-Clause
"""Print the length and cost of the least-cost path between two positions, and draw it."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._arguments import add_json, add_source, complete_layers, completed
from ._maps import check_free, read_map
from ._output import UsageError, message, number, print_json, print_table

if TYPE_CHECKING:
    from .. import planning
    from ..map import GridMap

_ENDINGS = (".jpg", ".pdf", ".png", ".svg")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_source(parser)
    for name in "start", "goal":
        about = "X,Y [m] in the frame of the map, or X,Y,YAW [rad]"
        parser.add_argument(name, metavar=name.upper(), type=_numbers, help=about)
    add = parser.add_argument_group("costs and limits").add_argument
    completed(add("--cost", metavar="LAYER", help="layer of costs"), complete_layers)
    about = "extra cost per meter at a cost of 252 (1)"
    add("--cost-weight", type=float, default=1.0, metavar="NUMBER", help=about)
    about = "cost from which cells are blocked, 253 for costs of Nav2 (infinity)"
    add("--lethal", type=float, metavar="COST", help=about)
    completed(add("--elevation", metavar="LAYER", help="layer of heights"), complete_layers)
    about = "steepest slopes upwards, downwards and across the path [degrees]"
    add("--limits", type=float, nargs=3, metavar=("UP", "DOWN", "CROSS"), help=about)
    add("--max-step", type=float, metavar="HEIGHT", help="highest step between cells [m]")
    about = "outline of the robot: LENGTH,WIDTH or the radius of a circle [m]"
    add("--footprint", type=_numbers, metavar="SIZE", help=about)
    about = "cells of unknown cost are (%(default)s)"
    add("--unknown", choices=("blocked", "free"), default="blocked", help=about)
    about = "distance to accept from a goal that cannot be reached [m] (0)"
    add("--tolerance", type=float, default=0.0, metavar="DISTANCE", help=about)
    add = parser.add_argument_group("output").add_argument
    about = f"draw the path to this file ({', '.join(_ENDINGS)})"
    add("-o", "--output", metavar="PICTURE", type=Path, help=about)
    add("-f", "--force", action="store_true", help="replace an existing file")
    add_json(parser, "print JSON, with the positions, heights and yaws of the path")


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        expected = f"expected numbers separated by commas, got {text!r}"
        raise argparse.ArgumentTypeError(expected) from None


def run(options: argparse.Namespace) -> int:
    layers = [layer for layer in (options.cost, options.elevation) if layer is not None]
    if not layers:
        raise UsageError("expected --cost or --elevation, or both")
    if options.output is not None:
        if options.output.suffix.lower() not in _ENDINGS:
            expected = f"expected a name that ends in {', '.join(_ENDINGS)}"
            raise UsageError(f"{options.output}: {expected}")
        check_free(str(options.output), force=options.force)
    grid_map = read_map(options, layers)
    path = _find(grid_map, options)
    if options.json:
        arrays = {name: getattr(path, name).tolist() for name in ("positions", "heights", "yaws")}
        print_json({"length": path.length, "cost": path.cost, **arrays})
    else:
        print_table([("length", f"{number(path.length)} m"), ("cost", number(path.cost))])
    if options.output is not None:
        _draw(grid_map, layers[0], path, options.output)
        message(f"{options.output} is drawn")
    return 0


def _find(grid_map: "GridMap", options: argparse.Namespace) -> "planning.Path":
    from ..planning import Footprint, SlopeLimits, TravelGraph

    limits = footprint = None
    if options.limits is not None:
        limits = SlopeLimits(*map(math.radians, options.limits))
    if options.footprint is not None:
        shapes: dict[int, Any] = {1: Footprint.circle, 2: Footprint.rectangle}
        size = options.footprint
        if len(size) not in shapes:
            raise UsageError(f"--footprint: expected one or two numbers, got {len(size)}")
        footprint = shapes[len(size)](*size)
    graph = TravelGraph(
        grid_map,
        cost=options.cost,
        cost_weight=options.cost_weight,
        lethal=options.lethal,
        elevation=options.elevation,
        limits=limits,
        max_step=options.max_step,
        footprint=footprint,
        unknown=options.unknown,
    )
    return graph.path(options.start, options.goal, tolerance=options.tolerance)


def _draw(grid_map: "GridMap", layer: str, path: "planning.Path", file: Path) -> None:
    from ..errors import required
    from ..files._shared import new_file, storage_errors

    matplotlib: Any = required("matplotlib.figure", "a picture")
    figure = matplotlib.Figure(figsize=(9.0, 7.0), dpi=110, layout="constrained")
    axes = grid_map.plot(layer, figure.add_subplot())
    (line,) = axes.plot(*path.positions.T, color="red", linewidth=2.0)
    axes.plot(*path.positions[0], "o", color=line.get_color())
    axes.plot(*path.positions[-1], "*", color=line.get_color(), markersize=14.0)
    with storage_errors(file, "written"), new_file(file) as temporary:
        figure.savefig(temporary, format=file.suffix[1:])
