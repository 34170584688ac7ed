# SPDX-License-Identifier: BSD-3-Clause
"""Measure tiled maps: the cost per tile, and the time to read a window of a large store.

    python3 benchmarks/tiles.py --simulate 100000 [--threads 2] [--workers 2]
    python3 benchmarks/tiles.py --windows 200

`--simulate` processes the given number of empty tiles, in threads of one process and on a local
cluster of processes, and prints the time per tile and the peak memory of the client. `--windows`
creates a store of 31,623 x 31,623 cells with data near the middle, and times `get_submap` for
200 x 200 cells in four chunks. It prints the first time, and the median and maximum of the others.
"""

import argparse
import itertools
import logging
import multiprocessing
import resource
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from dask import config

from grid_map_core_py import GridMap
from grid_map_core_py.map import GridGeometry
from grid_map_core_py.tiled import (
    TiledMap,
    open_map,
)
from grid_map_core_py.tiled._source import Window

SIDE = 31_623
CHUNK = 1024
WINDOW = 200


class Nothing:
    """Source of one layer whose reads return nothing."""

    layers = ("elevation",)

    def describe(self) -> str:
        return "nothing"

    def prepare(self) -> None:
        """Do nothing."""

    def read(self, window: Window, names: Any) -> list[np.ndarray]:  # noqa: ARG002
        return [np.empty((0, 0), np.float32) for _ in names]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--simulate", type=int, metavar="TILES")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--windows", type=int, metavar="COUNT")
    options = parser.parse_args()
    if options.simulate:
        print("where          tiles  ms/tile  peak of the client [MB]")
        for name, where, count in (
            ("threads", threads, options.threads),
            ("processes", processes, options.workers),
        ):
            # The kernel reports the peak over the whole life of a process, so use a new process.
            pipe, other = multiprocessing.Pipe()
            arguments = (where, count, options.simulate, other)
            process = multiprocessing.get_context("spawn").Process(target=simulated, args=arguments)
            process.start()
            seconds, peak = pipe.recv()
            process.join()
            row = f"{options.simulate:9} {1e3 * seconds / options.simulate:8.3f} {peak:24.0f}"
            print(f"{count} {name:9}{row}")
    if options.windows:
        print_windows(options.windows)


def threads(count: int) -> Any:
    return config.set(num_workers=count)


def processes(count: int) -> Any:
    from distributed import Client, LocalCluster

    options = {"threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
    return Client(LocalCluster(count, silence_logs=logging.CRITICAL, **options))


def simulated(where: Callable[[int], Any], count: int, tiles: int, pipe: Any) -> None:
    """Send the time for all tiles [s], and the peak memory of this process [MB]."""
    from grid_map_core_py.tiled._engine import in_any_order

    with where(count):
        begin = time.perf_counter()
        finished = {number for number, _ in in_any_order(Tile(), range(tiles))}
        seconds = time.perf_counter() - begin
        assert finished == {*range(tiles)}
        pipe.send((seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3))


class Tile:
    """Task that carries the same data as a real run of a tiled map."""

    def __init__(self) -> None:
        geometry = GridGeometry.from_size((SIDE, SIDE), 0.1)
        self.site = TiledMap(Nothing(), geometry, (CHUNK, CHUNK))

    def __call__(self, number: int) -> None:
        window = self.site.tiles[number % len(self.site.tiles)]
        self.site.source.read(window, self.site.layers)


def print_windows(count: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "site.zarr")
        geometry = GridGeometry.from_size((SIDE, SIDE), 0.1)
        site = TiledMap.create(path, geometry, ["elevation"], chunks=CHUNK)
        # A common corner of four chunks.
        center = geometry.centers((16 * CHUNK, 16 * CHUNK)) + 0.05
        values = np.random.default_rng(0).normal(size=(2 * CHUNK, 2 * CHUNK))
        site.write(GridMap(np.multiply(values.shape, 0.1), 0.1, center, {"elevation": values}))
        del site
        length = (0.1 * WINDOW, 0.1 * WINDOW)
        times = []
        for number in itertools.count():
            begin = time.perf_counter()
            window = open_map(path).get_submap(center, length)
            times.append(1e3 * (time.perf_counter() - begin))
            assert np.isfinite(window["elevation"]).all()
            if number == count:
                break
        warm = times[1:]
        spread = f"median {statistics.median(warm):.1f} ms, largest {max(warm):.1f} ms"
        print(f"first window {times[0]:.1f} ms; of {count} more {spread}")


if __name__ == "__main__":
    main()
