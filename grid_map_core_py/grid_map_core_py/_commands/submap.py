# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Cut a rectangle out of a map, also out of one that is larger than memory."""

import argparse
from typing import TYPE_CHECKING, Any

from ..commands._arguments import add_destination, add_layers, add_source
from ..commands._maps import Destination, read_map, source_format
from ..commands._output import CommandError, UsageError

if TYPE_CHECKING:
    from ..map import GridMap


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `run` to a parser."""
    add_source(parser)
    add_destination(parser)
    add_layers(parser, "cut this layer, instead of all")
    group = parser.add_argument_group("rectangle")
    about = "its center [m] in the frame of the map"
    group.add_argument("--position", type=float, nargs=2, metavar=("X", "Y"), help=about)
    about = "its center on the earth [degrees], for maps with a reference system"
    group.add_argument("--lat", type=float, help=about)
    group.add_argument("--lon", type=float, help=about)
    about = "its sides along x and y [m]"
    group.add_argument(
        "--length", type=float, nargs=2, metavar=("A", "B"), required=True, help=about
    )


def run(options: argparse.Namespace) -> int:
    """Write the rectangle, and tell where it is."""
    on_earth = [options.lat, options.lon]
    given = [value is not None for value in (options.position, *on_earth)]
    if given not in ([True, False, False], [False, True, True]):
        raise UsageError("expected --position X Y, or --lat and --lon")
    destination = Destination(options)
    destination.tell(destination.write([(None, _cut(options))]))
    return 0


def _cut(options: argparse.Namespace) -> "GridMap":
    """Return the rectangle; of stores and rasters, only its chunks are read."""
    if source_format(options) not in ("zarr", "geotiff"):
        if options.position is None:
            raise CommandError(f"{options.source}: --lat and --lon are for zarr and geotiff")
        return read_map(options, options.layers).get_submap(options.position, options.length)
    from ..tiled import open_map

    site = open_map(options.source)
    position = options.position
    if position is None:
        on_earth: Any = site
        position = on_earth.position_of(options.lat, options.lon)
    return site.submap(position, options.length, options.layers)
