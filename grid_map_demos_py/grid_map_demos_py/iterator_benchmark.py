# SPDX-License-Identifier: BSD-3-Clause
"""Benchmark of ways to visit all cells of a map.

    iterator_benchmark [SIDE ...]

The program prints the times of two tasks on square maps with SIDE cells per side. One task computes
the larger of two layer values in every cell. The other task computes the mean of the 3 x 3 cells
around every cell. The program solves each task in several ways, from a Python loop to a single
NumPy or OpenCV call.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import takewhile

import cv2
import numpy as np

from grid_map_core_py import GridMap, map_cells, sliding_windows, window_array

SIDES = (100, 400)
LARGEST_SIDE = 2_000
RESOLUTION = 0.004
SECONDS = 0.05  # each function is repeated for at least this time [s]; the shortest run counts

Way = Callable[[GridMap], None]


def by_index_and_name(grid_map: GridMap) -> None:
    """Look up the layer for each cell; suitable only for a few cells."""
    for index in zip(*map_cells(grid_map), strict=True):
        grid_map["larger"][index] = max(grid_map["larger"][index], grid_map["random"][index])


def by_index(grid_map: GridMap) -> None:
    """Keep the layers in variables, and use Python integers as indices."""
    random, larger = grid_map["random"], grid_map["larger"]
    rows, cols = map_cells(grid_map)
    for row, column in zip(rows.tolist(), cols.tolist(), strict=True):
        larger[row, column] = max(larger[row, column], random[row, column])


def by_place(grid_map: GridMap) -> None:
    """Index the cells in memory order."""
    random, larger = grid_map["random"].ravel("K"), grid_map["larger"].ravel("K")
    for place in range(larger.size):
        larger[place] = max(larger[place], random[place])


def by_array_of_cells(grid_map: GridMap) -> None:
    """Index layers with arrays of cell indices; suitable for discs, polygons and lines."""
    random, larger = grid_map["random"], grid_map["larger"]
    cells = map_cells(grid_map)
    larger[cells] = np.maximum(larger[cells], random[cells])


def by_layer(grid_map: GridMap) -> None:
    """Use NumPy on whole layers; suitable if all cells are needed."""
    np.maximum(grid_map["larger"], grid_map["random"], out=grid_map["larger"])


def window_by_window(grid_map: GridMap) -> None:
    """Iterate over the sliding windows."""
    mean = grid_map["mean"]
    for index, window in sliding_windows(grid_map, "random", "inside", 3):
        mean[index] = window.mean()


def by_array_of_windows(grid_map: GridMap) -> None:
    """Use NumPy on the array of all sliding windows, which is a view of the layer."""
    grid_map["mean"][1:-1, 1:-1] = window_array(grid_map, "random", "inside", 3).mean(axis=(2, 3))


def by_image_filter(grid_map: GridMap) -> None:
    """Use OpenCV on the transposed layer, which OpenCV accepts without a copy."""
    grid_map["mean"][1:-1, 1:-1] = cv2.blur(grid_map["random"].T, (3, 3)).T[1:-1, 1:-1]


WAYS: dict[str, dict[str, Way]] = {
    "larger of two layers": {
        "index and name": by_index_and_name,
        "index": by_index,
        "place in memory": by_place,
        "array of cells": by_array_of_cells,
        "whole layer": by_layer,
    },
    "mean of 3 x 3 cells": {
        "window by window": window_by_window,
        "array of windows": by_array_of_windows,
        "image filter": by_image_filter,
    },
}


def make_map(side: int) -> GridMap:
    """Create a map with a random layer and two result layers."""
    grid_map = GridMap(np.full(2, side * RESOLUTION), RESOLUTION)
    grid_map["random"] = np.random.default_rng(1).uniform(-1.0, 1.0, grid_map.size)
    grid_map["larger"] = 0.0
    grid_map["mean"] = np.nan
    return grid_map


def shortest_time(way: Way, grid_map: GridMap) -> float:
    """Return the shortest run time of a function [s]."""
    end = time.perf_counter() + SECONDS
    times: list[float] = []
    while not times or time.perf_counter() < end:
        start = time.perf_counter()
        way(grid_map)
        times.append(time.perf_counter() - start)
    return min(times)


def table(sides: Sequence[int]) -> Iterator[str]:
    """Yield the lines of the table, each as soon as it is measured."""
    maps = [make_map(side) for side in sides]
    heads = (f"{side} x {side} [ms]" for side in sides)
    yield " ".join([f"{'':22}", *(f"{head:>18}" for head in heads), f"{'a cell [ns]':>12}"])
    for task, ways in WAYS.items():
        yield task
        for name, way in ways.items():
            times = [shortest_time(way, grid_map) for grid_map in maps]
            columns = [f"{1e3 * seconds:18.3f}" for seconds in times]
            nanoseconds = 1e9 * times[-1] / sides[-1] ** 2
            yield " ".join([f"  {name:20}", *columns, f"{nanoseconds:12.2f}"])


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table and return 0."""
    parser = argparse.ArgumentParser(
        prog="iterator_benchmark", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument(
        "sides",
        metavar="SIDE",
        nargs="*",
        type=_side,
        default=SIDES,
        help=f"cells per side of a map, 3 to {LARGEST_SIDE} ({', '.join(map(str, SIDES))})",
    )
    words = sys.argv[1:] if arguments is None else arguments
    # `ros2 run` may append arguments that are meant for ROS.
    options = parser.parse_args(list(takewhile(lambda word: word != "--ros-args", words)))
    for line in table(options.sides):
        print(line, flush=True)
    return 0


def _side(text: str) -> int:
    if text.isdecimal() and 3 <= int(text) <= LARGEST_SIDE:
        return int(text)
    raise argparse.ArgumentTypeError(f"expected a number from 3 to {LARGEST_SIDE}, got {text!r}")


if __name__ == "__main__":
    raise SystemExit(main())
