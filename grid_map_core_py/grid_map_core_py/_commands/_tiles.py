# SPDX-License-Identifier: BSD-3-Clause
"""Command-line options for tiled computation, and the computation itself."""

import argparse
import logging
import math
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from .._unfinished import scratch_folder
from ..errors import required
from ..limits import current_limits
from ._maps import Destination, describe, read_map, source_format
from ._output import CommandError, ProgressBar, UsageError, message

if TYPE_CHECKING:
    from ..map import GridMap
    from ..tiled import TiledMap

_TILED = ("zarr", "geotiff")
"""Formats that are read and written window by window."""

_RECTANGLE = ("position", "lat", "lon", "length")
"""Names of the options that `add_rectangle` adds."""

_OPTIONS = ("workers", "memory", "scheduler", "resume", "cog")
"""Options that apply only to tiled maps."""

_PATIENCE = 30  # maximum time to wait for a cluster [s]


def add_tiles(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("maps of any size, from .zarr or .tif to .zarr or .tif")
    where = group.add_mutually_exclusive_group()
    about = "start this number of processes (threads of this process)"
    where.add_argument("--workers", type=_count, metavar="N", help=about)
    about = "use the Dask cluster of this scheduler, such as tcp://host:8786"
    where.add_argument("--scheduler", metavar="ADDRESS", help=about)
    about = "largest memory of each process, such as 1GB"
    group.add_argument("--memory", metavar="SIZE", help=about)
    about = "continue an unfinished run: compute only the missing tiles"
    group.add_argument("--resume", action="store_true", help=about)
    about = "side of a tile and of a chunk of the store [cells] (that of the source, or 1024)"
    group.add_argument("--chunks", type=int, metavar="CELLS", help=about)
    about = "GeoTIFF: cloud-optimized, with overviews"
    group.add_argument("--cog", action="store_true", help=about)


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a number of at least 1, got {text}")
    return int(text)


def add_rectangle(parser: argparse.ArgumentParser, *, required: bool = False) -> None:
    group = parser.add_argument_group("rectangle")
    about = "its center [m] in the frame of the map"
    group.add_argument("--position", type=float, nargs=2, metavar=("X", "Y"), help=about)
    about = "its center on the earth [degrees], for maps with a reference system"
    group.add_argument("--lat", type=float, help=about)
    group.add_argument("--lon", type=float, help=about)
    about = "its sides along x and y [m]"
    group.add_argument(
        "--length", type=float, nargs=2, metavar=("A", "B"), required=required, help=about
    )


def read_rectangle(options: argparse.Namespace, layers: Iterable[str] | None = None) -> "GridMap":
    given = [name for name in _RECTANGLE if getattr(options, name) is not None]
    if given not in (["position", "length"], ["lat", "lon", "length"]):
        found = " and ".join(f"--{name}" for name in given)
        raise UsageError(f"expected --position or --lat and --lon, with --length; got {found}")
    position, kind = options.position, source_format(options)
    if kind not in _TILED:
        if position is None:
            text = f"--lat and --lon are for {' and '.join(_TILED)}, and this is {kind}"
            raise CommandError(f"{options.source}: {text}")
        return read_map(options, layers).get_submap(position, options.length)
    from ..tiled import open_map

    tiled_map = open_map(options.source)
    if position is None:
        earth: Any = tiled_map
        position = earth.position_of(options.lat, options.lon)
        if not math.isfinite(position[0]):
            text = f"expected a place in the reference system, got {options.lat} {options.lon}"
            raise UsageError(f"--lat and --lon: {text}")
    return tiled_map.get_submap(position, options.length, layers)


def has_rectangle(options: argparse.Namespace) -> bool:
    return any(getattr(options, name) is not None for name in _RECTANGLE)


def tiled_source(
    options: argparse.Namespace, destination: Destination | None = None, *, also_small: bool = False
) -> "TiledMap | None":
    """Return the source as a `TiledMap`, or None if it should be read as a whole.

    A map of at most `max_cells` cells is tiled only in conversions from or to Zarr, with
    `also_small`, or with an option in `_OPTIONS`.
    """
    source = source_format(options)
    target = None if destination is None else destination.format.name
    on_tiles = source in _TILED and target in (None, *_TILED)
    also_small = also_small or any(getattr(options, name, None) for name in _OPTIONS)
    if on_tiles and target in (None, "geotiff") and not also_small:
        rows, columns = describe(options)["map"]["size"]
        is_large = rows * columns > current_limits().max_cells
        on_tiles = is_large or (target is not None and source == "zarr")
    if on_tiles:
        from ..tiled import open_map

        return open_map(options.source, chunks=getattr(options, "chunks", None))
    for name in _OPTIONS:
        if getattr(options, name, None):
            formats = " or ".join(_TILED)
            raise UsageError(
                f"--{name} is for maps that are converted or filtered from {formats} to {formats}"
            )
    return None


def write_tiles(
    tiled_map: "TiledMap",
    destination: Destination,
    options: argparse.Namespace,
    threads: int | None = None,
    **progress: Any,
) -> None:
    """Compute a map tile by tile, and write it to a Zarr store or GeoTIFF file.

    `threads=None` uses one thread per processor. `progress` contains arguments of `ProgressBar`.
    """
    if options.memory and not options.workers:
        raise UsageError("--memory goes with --workers")
    from .._arrays._checks import as_crs
    from ..map._merge import is_same_crs

    crs = as_crs(getattr(options, "crs", None))
    if crs and not is_same_crs(tiled_map.crs, crs):
        tiled_map = replace(tiled_map, crs=crs, origin=(0.0, 0.0))
    rows, columns = tiled_map.size
    cells = rows * columns / len(tiled_map.tiles)
    common = {"layers": options.layers, "overwrite": options.force}
    with _scheduler(options, threads), ProgressBar(unit="tiles", cells=cells, **progress) as bar:
        if destination.format.name == "zarr":
            tiled_map.to_zarr(destination.path, resume=options.resume, progress=bar, **common)
        elif options.resume:
            raise UsageError("--resume is for zarr, and this is geotiff")
        else:
            raster: Any = tiled_map
            raster.to_geotiff(destination.path, cog=options.cog, progress=bar, **common)
    message(f"{rows} x {columns} cells in {destination.path}")


@contextmanager
def _scheduler(options: argparse.Namespace, threads: int | None) -> Iterator[None]:
    """Make Dask use the threads, processes or cluster that `options` select."""
    if options.scheduler is None and options.workers is None:
        config = required("dask", f"{options.source}: tiles").config
        with config.set({} if threads is None else {"num_workers": max(1, threads)}):
            yield
        return
    distributed = required("distributed", "a cluster")
    # Logging would only repeat errors that are also raised.
    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    if options.scheduler is None:
        with _processes(distributed, options.workers, options.memory or "auto"):
            yield
        return
    try:
        client = distributed.Client(options.scheduler)
        client.wait_for_workers(1, timeout=_PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        text = f"{options.scheduler}: the scheduler cannot be reached, or has no workers: {error}"
        raise CommandError(text) from error
    try:
        yield
    finally:
        # If the connection to the scheduler is lost, closing would wait for it.
        client.close(timeout=2)


@contextmanager
def _processes(distributed: Any, count: int, memory: str) -> Iterator[None]:
    from dask import utils

    parse: Any = utils.parse_bytes
    try:
        limit = memory if memory == "auto" else parse(memory)
    except ValueError as error:
        text = f"--memory: expected a size such as 1GB, got {memory}"
        raise UsageError(text) from error
    # Hides a harmless warning of the resource tracker about semaphores left after a signal.
    os.environ.setdefault("PYTHONWARNINGS", "ignore:resource_tracker")
    with scratch_folder() as folder:
        cluster = distributed.LocalCluster(
            count,
            threads_per_worker=1,
            memory_limit=limit,
            local_directory=str(folder),
            silence_logs=logging.CRITICAL,
            # No dashboard, and no port that other machines can reach.
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
        )
        with cluster, distributed.Client(cluster):
            yield
