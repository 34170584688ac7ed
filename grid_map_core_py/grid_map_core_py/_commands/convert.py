# SPDX-License-Identifier: BSD-3-Clause
"""Convert maps between file formats; make maps from clouds, meshes and height images."""

import argparse
from collections.abc import Iterator
from dataclasses import replace

from ..errors import GridMapError
from ._arguments import add_destination, add_json, add_layers, add_source
from ._maps import Destination, TimedMap, open_records
from ._output import ProgressBar, UsageError, message
from ._tiles import add_tiles, tiled_source, write_tiles


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_source(parser, "all, if the destination is a bag, else the last one")
    add_destination(parser)
    add_layers(parser, "convert this layer, instead of all")
    add_tiles(parser)
    parser.add_argument(
        "--frame", help="coordinate frame of the map (default: frame of the source)"
    )
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    add_json(parser, "print the progress of a run on tiles as lines of JSON")


def run(options: argparse.Namespace) -> int:
    from ..files._formats import options_of

    destination = Destination(options)
    if len(options.layers or ()) > 1 and "layer" in options_of(destination.format.save, 2):
        raise UsageError(f"expected one --layer, because {destination.format.name} holds one layer")
    tiled_map = tiled_source(options, destination)
    if tiled_map is not None:
        if options.frame is not None:
            tiled_map = replace(tiled_map, frame_id=options.frame)
        write_tiles(tiled_map, destination, options, quiet=options.quiet, as_json=options.json)
        return 0
    if options.frame is None and destination.takes_all(options):
        destination.write_all(options)
        return 0
    with (
        open_records(options, destination, options.layers) as records,
        ProgressBar(quiet=options.quiet or len(records) < 2) as progress,
    ):

        def maps() -> Iterator[TimedMap]:
            for done, record in enumerate(records, 1):
                try:
                    grid_map = record.grid_map(options.layers, unwrap=False)
                except GridMapError as error:
                    if not options.recover:
                        raise
                    message(f"left out: {error}")
                    continue
                if options.frame is not None:
                    grid_map.frame_id = options.frame
                yield record.time, grid_map
                del grid_map
                progress(done, len(records))

        count = destination.write(maps())
    destination.tell(count)
    return 0
