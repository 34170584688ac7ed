# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A chain over the maps of a bag, without a node: the executable `filter_bag` and its function.

This module alone of the library needs `grid_map_ros_py` and the message packages, but not rclpy.
"""

import argparse
import sys
import warnings
from collections.abc import Sequence
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import Any

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_ros_py.bags import COMPRESSIONS, BagReader, BagRecord, BagWriter
from grid_map_ros_py.errors import BagError

from .._chain import FilterChain, StepObserver
from .._filter import FilterWarning
from .._offline import Failure, Progress, filter_maps
from .._progress import ProgressBar

OUTPUT_TOPIC = "/filtered_map"


def filter_bag(
    chain: FilterChain,
    source: str | PathLike[str],
    destination: str | PathLike[str],
    topic: str | None = None,
    *,
    output_topic: str = OUTPUT_TOPIC,
    overwrite: bool = True,
    compression: str = "none",
    failures: list[Failure] | None = None,
    observer: StepObserver | None = None,
    progress: Progress | None = None,
) -> int:
    """Filter the maps of a bag into a new bag, one at a time.

    The new bag is written atomically. It holds the filtered maps alone, each recorded
    when its map was.

    Args:
        chain: filters that every map goes through.
        source: the bag, or a single file of one.
        destination: folder of the new bag.
        topic: the maps' topic in the source; None will do where it has a single topic of maps.
        output_topic: output topic of the filtered maps.
        overwrite: replace a bag that is there.
        compression: "none", "lz4" or "zstd".
        failures, observer, progress: as for `filter_maps`.

    Returns:
        The number of maps in the new bag.

    Raises:
        FilterError: a map is damaged or cannot be filtered, and `failures` is None.
        BagError: a bag cannot be read or written, or no map was left.
    """
    if _same(Path(source), Path(destination)):
        raise BagError(destination, "is the source, too; its other topics would be lost")
    count = 0
    with ExitStack() as stack:
        reader = stack.enter_context(BagReader(source, topic))
        writer = stack.enter_context(
            BagWriter(destination, overwrite=overwrite, compression=compression)
        )
        for filtered in filter_maps(
            chain, reader, load=_load, failures=failures, observer=observer, progress=progress
        ):
            writer.write(output_topic, filtered.grid_map, time=filtered.item.time)
            count += 1
            del filtered
    return count


def _load(record: BagRecord) -> GridMap:
    return record.grid_map(unwrap=False)


def _same(source: Path, destination: Path) -> bool:
    bag = source.resolve()
    return destination.resolve() == (bag.parent if bag.is_file() else bag)


# --- executable -----------------------------------------------------------------------------------


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the executable and return its exit code: 0, 1 after an error, 130 after an interrupt."""
    options = _parser().parse_args(arguments)
    failures: list[Failure] | None = [] if options.keep_going else None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("once", FilterWarning)
            warnings.showwarning = _show_warning
            count = _run(options, failures)
    except KeyboardInterrupt:
        return 130
    except (GridMapError, OSError) as error:
        _print(str(error))
        return 1
    for failure in failures or ():
        _print(f"left out {failure}")
    _print(f"{count} maps on {options.output_topic} in {options.destination}")
    return 0


def _run(options: argparse.Namespace, failures: list[Failure] | None) -> int:
    chain = FilterChain.from_yaml(options.chain, options.name)
    with ExitStack() as stack:
        progress = None if options.quiet else stack.enter_context(ProgressBar())
        return filter_bag(
            chain,
            options.source,
            options.destination,
            options.topic,
            output_topic=options.output_topic,
            overwrite=not options.keep,
            compression=options.compression,
            failures=failures,
            progress=progress,
        )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="filter_bag", description="Filter the maps of a bag into a new bag."
    )
    parser.add_argument("chain", help="parameter file with the filter chain")
    parser.add_argument("source", help="bag to read: a folder, or an .mcap or .db3 file")
    parser.add_argument("destination", help="folder of the bag to write")
    parser.add_argument("--topic", help="of the maps, where the source has several topics of maps")
    parser.add_argument(
        "--output-topic", default=OUTPUT_TOPIC, help="of the filtered maps (%(default)s)"
    )
    parser.add_argument(
        "--name", default="filters", help="parameter that holds the chain (%(default)s)"
    )
    parser.add_argument(
        "--compression", choices=COMPRESSIONS, default="none", help="of the new bag (%(default)s)"
    )
    parser.add_argument(
        "--keep-going", action="store_true", help="leave out maps that cannot be filtered"
    )
    parser.add_argument("--keep", action="store_true", help="do not replace a bag that is there")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    return parser


def _print(text: str) -> None:
    print(f"filter_bag: {text}", file=sys.stderr)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    _print(f"warning: {message}")


if __name__ == "__main__":
    sys.exit(main())
