# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map convert`: maps from one format to another."""

import argparse
import math
from collections.abc import Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING

from .arguments import SOURCES, add_choice_of_map, add_destination, add_layers, add_source
from .errors import UsageError
from .formats import Format, format_of_source

if TYPE_CHECKING:
    from grid_map_core_py import GridMap

    from .writing import Destination, TimedMap

HELP = "convert between bags, .npz, images and GeoTIFF; make maps of point clouds and meshes"

TOPIC = "/grid_map"
"""Of maps that had none."""

FRAME = "map"
"""Of points and meshes, whose files name none."""

_REDUCTIONS = ("max", "min", "mean", "median", "first", "last", "variance", "count")


_OF_CLOUDS = {
    "--resolution": "resolution",
    "--as": "kind",
    "--height-layer": "height_layer",
    "--reduce": "reduce",
    "--min-height": "min_height",
    "--max-height": "max_height",
}
"""Options, and where their values are."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what `run` needs."""
    add_source(parser, f"{SOURCES}; .pcd, .ply, .obj, .stl")
    add_destination(parser)
    add_layers(parser, "convert this layer, instead of all")
    parser.add_argument("--frame", help="frame of the map, in place of that of the source")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    add_choice_of_map(parser, "all, where the destination is a bag, else the last one")
    clouds = parser.add_argument_group("point clouds and meshes")
    clouds.add_argument("--resolution", type=float, help="side of a cell [m]")
    clouds.add_argument(
        "--as", dest="kind", choices=("points", "mesh"), help="(mesh, where there are faces)"
    )
    clouds.add_argument("--height-layer", default="elevation", help="(%(default)s)")
    clouds.add_argument(
        "--reduce", choices=_REDUCTIONS, default="max", help="of the points in a cell (%(default)s)"
    )
    clouds.add_argument(
        "--min-height", type=float, default=-math.inf, help="leave out points below [m]"
    )
    clouds.add_argument(
        "--max-height", type=float, default=math.inf, help="leave out points above [m]"
    )


def run(options: argparse.Namespace) -> int:
    """Convert, and say how many maps there were."""
    from .writing import Destination

    destination = Destination(options)
    found = format_of_source(options.source)
    if found is not Format.CLOUD:
        _check_for_map(options)
    if found is Format.BAG:
        count = _convert_bag(options, destination)
    else:
        grid_map = _from_cloud(options) if found is Format.CLOUD else _from_file(options)
        count = destination.write([(None, _in_frame(grid_map, options.frame))], TOPIC)
    destination.tell(count)
    return 0


def _check_for_map(options: argparse.Namespace) -> None:
    """Refuse what counts for clouds and meshes alone."""
    for name, place in _OF_CLOUDS.items():
        if getattr(options, place) != options.parser.get_default(place):
            raise UsageError(f"{name} is for point clouds and meshes")


def _from_file(options: argparse.Namespace) -> "GridMap":
    from .reading import read_map

    return read_map(options.source, options.topic, options.index, options.layers)


def _from_cloud(options: argparse.Namespace) -> "GridMap":
    from .clouds import Gridding, read_cloud
    from .reading import checked_format, with_layers_only

    checked_format(options.source, options.topic, options.index)
    gridding = Gridding(
        options.resolution,
        options.kind,
        options.height_layer,
        options.reduce,
        options.min_height,
        options.max_height,
    )
    grid_map = read_cloud(options.source, gridding, options.layers)
    return _in_frame(with_layers_only(grid_map, options.layers), FRAME)


def _in_frame(grid_map: "GridMap", frame: str | None) -> "GridMap":
    if frame is not None:
        grid_map.frame_id = frame
    return grid_map


def _convert_bag(options: argparse.Namespace, destination: "Destination") -> int:
    """Convert maps of a topic, one at a time."""
    from grid_map_filters_py import ProgressBar
    from grid_map_ros_py.bags import BagReader

    with BagReader(options.source, options.topic) as reader, ExitStack() as stack:
        records = destination.records(reader, options.index)
        is_long = len(records) > 1 and not options.quiet
        progress = stack.enter_context(ProgressBar()) if is_long else None

        def maps() -> Iterator["TimedMap"]:
            for done, record in enumerate(records, 1):
                grid_map = record.grid_map(options.layers, unwrap=False)
                yield record.time, _in_frame(grid_map, options.frame)
                del grid_map
                if progress:
                    progress(done, len(records))

        return destination.write(maps(), reader.topic)
