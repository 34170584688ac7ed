# SPDX-License-Identifier: BSD-3-Clause
"""Show range, mean, missing values and histogram of every layer."""

import argparse
from typing import TYPE_CHECKING, Any

from ._arguments import add_json, add_layers, add_source
from ._maps import read_map
from ._output import UsageError, number, print_json, print_table, shown

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

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
    from ..files._shared import (
        map_facts,
    )

    grid_map = read_map(options, options.layers)
    layers = [statistics_of(name, grid_map[name], options.bins) for name in grid_map]
    if options.json:
        info = map_facts(grid_map)
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


def statistics_of(name: str, layer: "npt.NDArray[np.float32]", bins: int) -> dict[str, Any]:
    """Return statistics and a histogram of the finite values of a layer as JSON values.

    For packed colors, or if no value is finite, the statistics are None and the histogram is empty.
    """
    import numpy as np

    is_color = name.endswith("color")
    nan = int(np.isnan(layer).sum())
    # Use double precision, so that neither sums nor bin widths overflow.
    finite = layer[np.isfinite(layer)].astype(np.float64)
    found: dict[str, Any] = {
        "name": name,
        "is_color": is_color,
        "cells": layer.size,
        "nan": nan,
        "infinite": layer.size - nan - finite.size,
        **dict.fromkeys(("min", "max", "mean", "std")),
        "histogram": {"edges": [], "counts": []},
    }
    if is_color or not finite.size:
        return found
    lowest, highest = float(finite.min()), float(finite.max())
    # If all values are equal, center the histogram on them.
    margin = max(0.5, 1e-3 * abs(lowest)) if lowest == highest else 0.0
    counts, edges = np.histogram(finite, bins, (lowest - margin, highest + margin))
    mean, deviation = float(finite.mean()), float(finite.std())
    found |= {"min": lowest, "max": highest, "mean": mean, "std": deviation}
    return found | {"histogram": {"edges": edges.tolist(), "counts": counts.tolist()}}


def _row(layer: dict[str, Any]) -> tuple[str, ...]:
    values = (layer[name] for name in ("min", "max", "mean", "std"))
    numbers = ("-" if value is None else number(value) for value in values)
    missing = f"{layer['nan'] / layer['cells']:.1%}" if layer["nan"] else "0"
    counts = layer["histogram"]["counts"]
    bars = "(packed colors)" if layer["is_color"] else sparkline(counts)
    return (shown(layer["name"]), *numbers, missing, str(layer["infinite"]), bars)


def sparkline(counts: list[int]) -> str:
    """Return a bar character for each number; only zeros are blank."""
    highest, steps = max(counts, default=0), len(BLOCKS) - 1
    return "".join(BLOCKS[-(-steps * count // highest)] if count else BLOCKS[0] for count in counts)
