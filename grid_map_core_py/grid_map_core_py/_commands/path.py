# SPDX-License-Identifier: BSD-3-Clause
"""Print the length and cost of the least-cost path between two positions, and draw it."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._arrays._checks import Positions
from ._arguments import add_json, add_source, complete_layers, completed
from ._maps import check_free, read_map
from ._output import UsageError, message, number, print_json, print_table

if TYPE_CHECKING:
    from ..map import GridMap

DEFAULT = "elevation"
_ENDINGS = (".jpg", ".pdf", ".png", ".svg")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_source(parser)
    for name in "start", "goal":
        about = "X,Y [m] in the frame of the map, or X,Y,YAW [rad]"
        parser.add_argument(name, metavar=name.upper(), type=_numbers, help=about)
    add = parser.add_argument_group("costs and limits").add_argument
    completed(add("--cost", metavar="LAYER", help="cost layer"), complete_layers)
    about = "extra cost per meter at a cost of 252 (1)"
    add("--cost-weight", type=float, default=1.0, metavar="NUMBER", help=about)
    about = "cost from which cells are blocked, 253 for costs of Nav2"
    add("--lethal", type=float, metavar="COST", help=about)
    about = f"layer of heights ({DEFAULT}, if there is no --cost)"
    completed(add("--elevation", metavar="LAYER", help=about), complete_layers)
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
    from ..planning import Footprint, SlopeLimits, TravelGraph

    layers, output = [*filter(None, (options.cost, options.elevation))], options.output
    if not layers:
        layers = [DEFAULT]
        options.elevation = DEFAULT
    if output is not None and output.suffix.lower() not in _ENDINGS:
        raise UsageError(f"{output}: expected a name that ends in {', '.join(_ENDINGS)}")
    if output is not None:
        check_free(str(output), force=options.force)
    shapes: dict[int, Any] = {0: lambda: None, 1: Footprint.circle, 2: Footprint.rectangle}
    size = options.footprint or []
    if len(size) not in shapes:
        raise UsageError(f"--footprint: expected one or two numbers, got {len(size)}")
    names = "cost", "cost_weight", "lethal", "elevation", "max_step", "unknown"
    arguments = {name: getattr(options, name) for name in names}
    if options.limits is not None:
        if not all(0.0 <= angle <= 90.0 for angle in options.limits):
            raise UsageError(f"--limits: expected 0 to 90 degrees, got {options.limits}")
        arguments["limits"] = SlopeLimits(*map(math.radians, options.limits))
    grid_map = read_map(options, layers)
    graph = TravelGraph(grid_map, footprint=shapes[len(size)](*size), **arguments)
    path = graph.path(options.start, options.goal, tolerance=options.tolerance)
    if options.json:
        print_json({name: np.asarray(value).tolist() for name, value in vars(path).items()})
    else:
        print_table([("length", f"{number(path.length)} m"), ("cost", number(path.cost))])
    if output is not None:
        _draw(grid_map, layers[0], path.positions, output)
        message(f"{output} is drawn")
    return 0


def _draw(grid_map: "GridMap", layer: str, positions: Positions, file: Path) -> None:
    from ..errors import required
    from ..files._shared import new_file, storage_errors

    matplotlib: Any = required("matplotlib.figure", "a picture")
    figure = matplotlib.Figure(figsize=(9.0, 7.0), dpi=110, layout="constrained")
    axes = grid_map.plot(layer, figure.add_subplot())
    (line,) = axes.plot(*positions.T, color="red", linewidth=2.0)
    axes.plot(*positions[0], "o", color=line.get_color())
    axes.plot(*positions[-1], "*", color=line.get_color(), markersize=14.0)
    with storage_errors(file, "written"), new_file(file) as temporary:
        figure.savefig(temporary, format=file.suffix[1:])
