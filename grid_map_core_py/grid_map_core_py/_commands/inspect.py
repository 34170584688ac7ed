# SPDX-License-Identifier: BSD-3-Clause
"""Show the range, mean, missing values and histogram of every layer."""

import argparse
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ._arguments import add_json, add_layers, add_source
from ._maps import describe, read_map
from ._output import UsageError, number, print_json, print_table, shown
from ._tiles import tiled_source

if TYPE_CHECKING:
    from ..map import GridMap

BLOCKS = " ▁▂▃▄▅▆▇█"
WIDTH = 40
"""Length of the longest bar [characters]."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_source(parser)
    add_layers(parser, "show this layer, instead of all")
    parser.add_argument(
        "--bins", type=int, default=16, help="number of bins of the histograms (%(default)s)"
    )
    parser.add_argument("--histogram", action="store_true", help="show every bin of the histograms")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    if not 1 <= options.bins <= 1000:
        raise UsageError(f"--bins: expected a number from 1 to 1000, got {options.bins}")
    from ..files._shared import map_facts

    each: Callable[..., list[Any]]
    if (tiled_map := tiled_source(options)) is None:
        grid_map = read_map(options, options.layers)
        names, info, each = grid_map.layers, map_facts(grid_map), lambda f, _: [f(grid_map)]
    else:
        names, info = options.layers or tiled_map.layers, describe(options)["map"]
        each = tiled_map.over_tiles
    layers = [statistics_of(name, each, options.bins) for name in names]
    if options.json:
        print_json({"path": options.source, "map": info, "layers": layers})
        return 0
    head = ("layer", "min", "max", "mean", "std", "NaN", "infinite", "histogram")
    print_table([head, *map(_row, layers)], numbers=range(1, 7))
    for layer in layers if options.histogram else ():
        counts, edges = layer["histogram"]["counts"], layer["histogram"]["edges"]
        if counts:
            print(f"\n{shown(layer['name'])}")
            bars = [BLOCKS[-1] * round(WIDTH * count / max(counts)) for count in counts]
            rows = [
                (number(low), "..", number(high), str(count), bar)
                for low, high, count, bar in zip(edges[:-1], edges[1:], counts, bars, strict=True)
            ]
            print_table(rows, numbers=(0, 2, 3))
    return 0


def statistics_of(name: str, each: Callable[..., list[Any]], bins: int) -> dict[str, Any]:
    """Return statistics and a histogram of the finite values of a layer, as JSON values.

    The statistics are None for packed colors, or if no value is finite. `each(function, layers)`
    returns `function(tile)` for each tile of the map.
    """
    import numpy as np

    # In double precision, neither sums nor bin widths overflow.
    def finite_of(tile: "GridMap") -> Any:
        return tile[name][np.isfinite(tile[name])].astype(np.float64)

    def extent(tile: "GridMap") -> tuple[Any, ...]:
        finite, nan = finite_of(tile), np.isnan(tile[name]).sum()
        lowest, highest = finite.min(initial=np.inf), finite.max(initial=-np.inf)
        return tile[name].size, nan, finite.size, finite.sum(), lowest, highest

    def spread(tile: "GridMap") -> tuple[Any, Any]:
        finite = finite_of(tile)
        return np.histogram(finite, bins, ends)[0], ((finite - mean) ** 2).sum()

    *sums, lows, highs = zip(*each(extent, [name]), strict=True)
    cells, nan, count, total = map(sum, sums)
    found: dict[str, Any] = {
        "name": name,
        "is_color": name.endswith("color"),
        "cells": cells,
        "nan": int(nan),
        "infinite": int(cells - nan - count),
        **dict.fromkeys(("min", "max", "mean", "std")),
        "histogram": {"edges": [], "counts": []},
    }
    if found["is_color"] or not count:
        return found
    lowest, highest, mean = float(min(lows)), float(max(highs)), float(total / count)
    # If all values are equal, center the histogram on them.
    margin = max(0.5, 1e-3 * abs(lowest)) if lowest == highest else 0.0
    ends = lowest - margin, highest + margin
    counts, squares = map(sum, zip(*each(spread, [name]), strict=True))
    found |= {"min": lowest, "max": highest, "mean": mean, "std": math.sqrt(squares / count)}
    edges = np.histogram_bin_edges([], bins, ends).tolist()
    return found | {"histogram": {"edges": edges, "counts": np.asarray(counts).tolist()}}


def _row(layer: dict[str, Any]) -> tuple[str, ...]:
    values = (layer[name] for name in ("min", "max", "mean", "std"))
    numbers = ("-" if value is None else number(value) for value in values)
    missing = f"{layer['nan'] / layer['cells']:.1%}" if layer["nan"] else "0"
    counts = layer["histogram"]["counts"]
    bars = "(packed colors)" if layer["is_color"] else sparkline(counts)
    return (shown(layer["name"]), *numbers, missing, str(layer["infinite"]), bars)


def sparkline(counts: list[int]) -> str:
    """Return one bar character per number; only 0 becomes a blank."""
    highest, steps = max(counts, default=0), len(BLOCKS) - 1
    return "".join(BLOCKS[-(-steps * count // highest)] if count else BLOCKS[0] for count in counts)
