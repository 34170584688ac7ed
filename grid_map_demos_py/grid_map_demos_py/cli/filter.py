# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map filter`: a filter chain over a map or over a whole bag."""

import argparse
import sys
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, redirect_stdout
from typing import TYPE_CHECKING, Any

from . import output
from .arguments import add_choice_of_map, add_destination, add_json, add_source
from .errors import UsageError
from .formats import STANDARD, Format, format_of_source
from .output import print_json

if TYPE_CHECKING:
    from grid_map_filters_py import Failure, FilterChain, StepTimes

    from .writing import Destination, TimedMap

HELP = "run a filter chain over a map, or over all maps of a bag"

TOPIC = "/filtered_map"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what `run` needs."""
    parser.add_argument("chain", help="parameter file with the chain, or - for standard input")
    add_source(parser)
    add_destination(parser)
    parser.add_argument(
        "--name", default="filters", help="parameter that holds the chain (%(default)s)"
    )
    parser.add_argument("--timing", action="store_true", help="print how long each filter took")
    add_json(parser)
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    add_choice_of_map(parser, "all, where the destination is a bag, else the last one")
    parser.add_argument(
        "--keep-going", action="store_true", help="leave out maps that cannot be filtered"
    )


def run(options: argparse.Namespace) -> int:
    """Filter, and say how many maps there were."""
    from grid_map_filters_py import FilterChain, FilterWarning, StepTimes

    from .writing import Destination

    if options.chain == options.source == STANDARD:
        raise UsageError("the chain and the map cannot both come from standard input")
    if options.json and not options.timing:
        raise UsageError("--json is for what --timing prints")
    path = "/dev/stdin" if options.chain == STANDARD else options.chain
    chain = FilterChain.from_yaml(path, options.name)
    destination = Destination(options)
    failures: list[Failure] | None = [] if options.keep_going else None
    times = StepTimes()
    with warnings.catch_warnings():
        warnings.simplefilter("once", FilterWarning)
        warnings.showwarning = _show_warning
        count = _filtered(options, chain, destination, failures, times)
    for failure in failures or ():
        output.message(f"left out {failure}")
    destination.tell(count)
    if options.timing:
        with redirect_stdout(sys.stderr if destination.path == STANDARD else sys.stdout):
            _print_times(times, as_json=options.json)
    return 0


def _filtered(
    options: argparse.Namespace,
    chain: "FilterChain",
    destination: "Destination",
    failures: "list[Failure] | None",
    times: "StepTimes",
) -> int:
    """Write the filtered maps and return how many there are."""
    from grid_map_filters_py import ProgressBar, filter_maps

    with ExitStack() as stack:
        items: Any
        if format_of_source(options.source) is Format.BAG:
            from grid_map_ros_py.bags import BagReader

            reader = stack.enter_context(BagReader(options.source, options.topic))
            items = destination.records(reader, options.index)
        else:
            from .reading import read_map

            items = [read_map(options.source, options.topic, options.index)]
        is_long = len(items) > 1 and not options.quiet
        progress = stack.enter_context(ProgressBar()) if is_long else None

        def maps() -> Iterator["TimedMap"]:
            for filtered in filter_maps(
                chain, items, load=_load, failures=failures, observer=times, progress=progress
            ):
                yield getattr(filtered.item, "time", None), filtered.grid_map
                del filtered

        return destination.write(maps(), TOPIC)


def _load(item: Any) -> Any:
    """Return the map of a record of a bag, or the map that is given."""
    return item.grid_map(unwrap=False) if hasattr(item, "grid_map") else item


def _print_times(times: "StepTimes", *, as_json: bool) -> None:
    if not as_json:
        print(times)
        return
    print_json(
        [
            {
                "name": time.config.name,
                "type": time.config.type,
                "maps": time.runs,
                "last_ms": time.last,
                "mean_ms": time.mean,
                "max_ms": time.longest,
            }
            for time in times
        ]
    )


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    output.message(f"warning: {message}")
