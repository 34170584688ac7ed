# SPDX-License-Identifier: BSD-3-Clause
"""Measure the traversability chain of the demo on maps larger than memory.

    python3 benchmarks/large_maps.py [--cells 20000] [--workers 1 2] [--layers traversability]
        [--folder /tmp/large_maps]

Writes a terrain with holes to a GeoTIFF file in the folder, unless the file exists. Single-threaded
worker processes filter the file into a Zarr store. Prints one line per worker count: the time, the
nanoseconds per cell and core, the speed relative to the same chain on one map of 1000 x 1000 cells
in memory, and the largest peak memory of a worker. `--layers` selects the layers to write, by
default all eleven. Pass several `--cells` to see how the time grows. Run it in the workspace
environment (`. tools/env.sh`), on an idle machine. 20,000 x 20,000 cells need 2 GB on disk, and
15 GB for all layers of the result.
"""

import argparse
import shutil
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import cv2

from grid_map_core_py.tiled import TiledMap, open_map
from grid_map_filters_py import FilterChain

HERE = Path(__file__).parent
CHAIN = HERE.parent / "grid_map_demos_py/config/filters_demo_filter_chain.yaml"
STANDARD = 1000
"""Side of the map in memory [cells]."""

SECONDS = 5.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, nargs="+", default=[20_000])
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--layers", nargs="+")
    parser.add_argument("--folder", type=Path, default=Path("/tmp/large_maps"))
    options = parser.parse_args()
    cv2.setNumThreads(1)  # OpenCV starts its own threads
    options.folder.mkdir(parents=True, exist_ok=True)
    # The terrain has no colors to delete.
    steps = FilterChain.from_yaml(CHAIN).steps
    chain = FilterChain(step for step in steps if step.config.name != "delete_color")
    in_memory = None
    print("cells  workers  seconds  ns/cell/core  of memory  peak MB")
    for cells in options.cells:
        site = open_map(terrain(options.folder, cells))
        in_memory = in_memory or seconds_in_memory(chain, site)
        for workers in options.workers:
            target = options.folder / "result.zarr"
            shutil.rmtree(target, ignore_errors=True)
            small = open_map(terrain(options.folder, STANDARD), chunks=256)
            seconds, peak = filtered([small, site], chain, target, options.layers, workers)
            each = 1e9 * seconds * workers / cells**2
            share = in_memory / each
            print(f"{cells:5} {workers:8} {seconds:8.1f} {each:13.1f} {share:10.2f} {peak:8.0f}")
    print(f"in memory: {in_memory:.1f} ns per cell of one map of {STANDARD} x {STANDARD} cells")


def terrain(folder: Path, cells: int) -> Path:
    """Return the path of the terrain GeoTIFF; create the file if it does not exist."""
    file = folder / f"terrain_{cells}.tif"
    if not file.exists():
        command = [sys.executable, HERE / "make_terrain.py", "--cells", str(cells), "--out", file]
        subprocess.run([str(part) for part in command], check=True)
    return file


def seconds_in_memory(chain: FilterChain, site: TiledMap) -> float:
    """Return the smallest time per cell of a map in memory [ns]."""
    grid_map = site.get_block(slice(0, STANDARD), slice(0, STANDARD))
    chain(grid_map)  # compiles
    times, end = [], time.monotonic() + SECONDS
    while time.monotonic() < end:
        begin = time.perf_counter()
        chain(grid_map)
        times.append(time.perf_counter() - begin)
    return 1e9 * min(times) / STANDARD**2


def filtered(
    sites: list[TiledMap], chain: FilterChain, target: Path, layers: list[str] | None, workers: int
) -> tuple[float, float]:
    """Filter maps in worker processes; return the last map's time [s] and a worker's peak [MB].

    The first map warms up the workers, which import packages.
    """
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        client.run(partial(cv2.setNumThreads, 1))
        for site in sites:
            begin = time.perf_counter()
            site.filter(chain).to_zarr(target, layers=layers, overwrite=True)
            seconds = time.perf_counter() - begin
        return seconds, max(client.run(peak).values())


def peak() -> float:
    """Return the peak memory of this process [MB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


if __name__ == "__main__":
    main()
