# SPDX-License-Identifier: BSD-3-Clause
"""Measure how time per cell and memory of the demo filter chain grow with the map size.

    python3 benchmarks/growth.py [--cells 200 400 1000 2000 4000 8000] [--threads 1 2] [--keep]

Prints one line per map size and thread count. The line contains the smallest time per cell of
several runs, and the smallest processor time per cell, which depends less on other load; both also
relative to a map of 1000 x 1000 cells. The last column is the peak memory, relative to the layers
of input and result. Each size runs in its own process. `--keep` keeps freed memory, as nodes with
large maps do, and does not measure the peak. Run it in the workspace environment
(`. tools/env.sh`). 8000 x 8000 cells need 7 GB and a minute.
"""

import argparse
import gc
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import cv2
from terrain import terrain

from grid_map_core_py.limits import set_limits
from grid_map_filters_py import FilterChain

CHAIN = Path(__file__).parent.parent / "grid_map_demos_py/config/filters_demo_filter_chain.yaml"
CELLS = [200, 400, 1000, 2000, 4000, 8000]
STANDARD = 1000
"""Side of the reference map [cells]."""

SECONDS = 5.0
LEAST_RUNS = 3
KEEP = {"MALLOC_MMAP_MAX_": "0", "MALLOC_TRIM_THRESHOLD_": str(1 << 30)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, nargs="+", default=CELLS)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--keep", action="store_true", help="keep freed memory, as nodes do")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(options.cells[0], options.threads[0])))
        return
    print("threads  cells  ns/cell  to 1000  cpu ns/cell  to 1000  peak / layers")
    for threads in options.threads:
        rows = {cells: in_process(cells, threads, keep=options.keep) for cells in options.cells}
        for cells, row in rows.items():
            standard = rows.get(STANDARD, row)
            times = (f"{row[k]:8.1f} {row[k] / standard[k]:8.2f}" for k in ("wall", "cpu"))
            peak = "-" if options.keep else f"{row['peak']:.2f}"
            print(f"{threads:7} {cells:6} {'     '.join(times)}  {peak:>13}")


def in_process(cells: int, threads: int, *, keep: bool) -> dict[str, float]:
    """Return the result of `measured`, computed in another process."""
    command = [sys.executable, __file__, "--one", "--cells", str(cells), "--threads", str(threads)]
    given = os.environ | (KEEP if keep else {})
    output = subprocess.run(command, env=given, check=True, stdout=subprocess.PIPE).stdout
    found: dict[str, float] = json.loads(output)
    return found


def measured(cells: int, threads: int) -> dict[str, float]:
    """Return the smallest times per cell [ns], and the peak memory relative to all layers."""
    set_limits(max_cells=cells**2)
    cv2.setNumThreads(1)  # OpenCV starts its own threads
    chain = FilterChain.from_yaml(CHAIN, threads=threads)
    small = terrain(300)
    small["color"] = 0.0
    chain(small)  # compiles, and allocates permanent memory
    grid_map = terrain(cells)
    grid_map["color"] = 0.0
    peak = peak_beside(lambda: chain(grid_map), grid_map)
    wall, cpu, end = [], [], time.monotonic() + SECONDS
    while len(wall) < LEAST_RUNS or time.monotonic() < end:
        begin = time.perf_counter(), time.process_time()
        chain(grid_map)
        wall.append(time.perf_counter() - begin[0])
        cpu.append(time.process_time() - begin[1])
    per_cell = 1e9 / cells**2
    return {"wall": per_cell * min(wall), "cpu": per_cell * min(cpu), "peak": peak}


def peak_beside(operation, grid_map) -> float:
    """Return the peak memory of an operation, relative to the layers of its input and result."""
    gc.collect()
    layers = sum(grid_map[name].nbytes for name in grid_map)
    before = status("VmRSS") - layers
    Path("/proc/self/clear_refs").write_text("5")  # resets the peak
    result = operation()
    peak = status("VmHWM") - before
    return peak / (layers + sum(result[name].nbytes for name in result))


def status(key: str) -> int:
    """Return a value of /proc/self/status in bytes."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(key))


if __name__ == "__main__":
    main()
