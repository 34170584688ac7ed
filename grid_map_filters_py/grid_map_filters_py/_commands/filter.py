# SPDX-License-Identifier: BSD-3-Clause
"""Run a filter chain on a map of any size, or on all maps of a bag."""

import argparse
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

from grid_map_core_py._commands import (
    Destination,
    ProgressBar,
    UsageError,
    add_destination,
    add_json,
    add_source,
    add_tiles,
    message,
    open_records,
    print_json,
    tiled_source,
    write_tiles,
)

from .._chain import FilterChain
from .._offline import Failure, filter_maps
from .._times import StepTimes

if TYPE_CHECKING:
    from grid_map_core_py import GridMap
    from grid_map_core_py.files._formats import MapRecord

_YAML = (".yaml", ".yml")
_ON_TILES = ("layers", "max_hole", "large_holes")
_IN_MEMORY = ("timing", "keep_going")
"""Options only for maps in memory; `_ON_TILES` contains the options only for tiled maps."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line arguments of `grid-map filter` to a parser."""
    parser.add_argument("chain", help="parameter file with the chain, or - for standard input")
    add_source(parser, "all, if the destination is a bag, else the last one")
    add_destination(parser)
    parser.add_argument(
        "--name", default="filters", help="parameter that contains the chain (%(default)s)"
    )
    about = "number of threads that the filters may use (1; on tiles, one per processor)"
    parser.add_argument("--threads", type=int, help=about)
    parser.add_argument("--timing", action="store_true", help="print how long each filter took")
    add_json(parser, "print the times as JSON; on tiles, the progress as lines of JSON")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    parser.add_argument(
        "--keep-going", action="store_true", help="skip maps that cannot be filtered"
    )
    add_tiles(parser)
    group = parser.add_argument_group("filters on maps of any size")
    about = "result layers to write (all)"
    group.add_argument("--layers", nargs="+", metavar="LAYER", help=about)
    about = "longest hole to fill, along rows or columns (the longer tile side)"
    group.add_argument("--max-hole", type=int, metavar="CELLS", help=about)
    about = "fail on longer holes (refuse), or do not fill them (leave)"
    group.add_argument("--large-holes", choices=("refuse", "leave"), help=about)


def run(options: argparse.Namespace) -> int:
    """Run `grid-map filter`, and print the number of written maps."""
    if options.chain == options.source == "-":
        raise UsageError("the chain and the map cannot both come from standard input")
    if Path(options.source).suffix in _YAML and Path(options.chain).suffix not in ("", *_YAML):
        raise UsageError(f"expected the chain first: {options.source} {options.chain}")
    path = "/dev/stdin" if options.chain == "-" else options.chain
    threads = 1 if options.threads is None else options.threads
    chain = FilterChain.from_yaml(path, options.name, threads=threads)
    destination = Destination(options, usual_topic="/filtered_map")
    tiled_map = tiled_source(options, destination)
    refused, where = (
        (_ON_TILES, "filtered on tiles, from zarr or geotiff to zarr, or from zarr to geotiff")
        if tiled_map is None
        else (_IN_MEMORY, "read at once")
    )
    if bad := [name for name in refused if getattr(options, name) not in (None, False)]:
        raise UsageError(f"--{bad[0].replace('_', '-')} is for maps that are {where}")
    if tiled_map is not None:
        holes = {"max_hole": options.max_hole, "large_holes": options.large_holes}
        given = {name: value for name, value in holes.items() if value is not None}
        shown = {"quiet": options.quiet, "as_json": options.json}
        filtered = tiled_map.filter(chain, **given)
        write_tiles(filtered, destination, options, options.threads, **shown)
        return 0
    if options.json and not options.timing:
        raise UsageError("--json requires --timing, or a map on tiles")
    failures: list[Failure] | None = [] if options.keep_going else None
    times = StepTimes()
    try:
        with (
            open_records(options, destination) as records,
            ProgressBar(quiet=options.quiet or len(records) < 2) as progress,
        ):

            def maps() -> "Iterator[tuple[int | None, GridMap]]":
                for result in filter_maps(
                    chain, records, load=_load, failures=failures, observer=times, progress=progress
                ):
                    yield result.item.time, result.grid_map
                    del result

            count = destination.write(maps())
    finally:
        for failure in failures or ():
            message(f"left out {failure}")
    destination.tell(count)
    if options.timing:
        with redirect_stdout(sys.stderr if destination.path == "-" else sys.stdout):
            print_json(times.facts()) if options.json else print(times)
    return 0


def _load(record: "MapRecord") -> "GridMap":
    return record.grid_map(unwrap=False)
