# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map inspect`: the values of the layers."""

import argparse
from typing import TYPE_CHECKING, Any

from .arguments import add_choice_of_map, add_json, add_layers, add_source
from .errors import UsageError
from .output import can_print, number, print_json, print_table, shown

if TYPE_CHECKING:
    from .layer_statistics import LayerStatistics

HELP = "show range, mean, missing values and histogram of every layer"

BLOCKS, ASCII_BLOCKS = " ▁▂▃▄▅▆▇█", " .:-=+*#@"
WIDTH = 40
"""Of the longest bar, in characters."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what `run` needs."""
    add_source(parser)
    add_choice_of_map(parser)
    add_layers(parser, "show this layer, instead of all")
    parser.add_argument("--bins", type=int, default=16, help="of the histograms (%(default)s)")
    parser.add_argument("--histogram", action="store_true", help="show the histograms at length")
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Print it."""
    if not 1 <= options.bins <= 1000:
        raise UsageError(f"--bins: expected a number from 1 to 1000, got {options.bins}")
    from .layer_statistics import statistics_of
    from .reading import info_of, read_map

    grid_map = read_map(options.source, options.topic, options.index, options.layers)
    layers = [statistics_of(name, grid_map[name], options.bins) for name in grid_map]
    if options.json:
        entries = [layer.as_dict() for layer in layers]
        info = info_of(grid_map).as_dict()
        print_json({"path": options.source, "map": info, "layers": entries})
        return 0
    _print(layers)
    for layer in layers if options.histogram else ():
        _print_histogram(layer)
    return 0


def _print(layers: "list[LayerStatistics]") -> None:
    head = ("layer", "min", "max", "mean", "std", "NaN", "infinite", "histogram")
    print_table([head, *map(_row, layers)], numbers=range(1, 7))


def _row(layer: "LayerStatistics") -> tuple[str, ...]:
    values: Any = (layer.minimum, layer.maximum, layer.mean, layer.deviation)
    numbers = ("-" if value is None else number(value) for value in values)
    missing = f"{layer.nan / layer.cells:.1%}" if layer.nan else "0"
    bars = "(packed colours)" if layer.is_color else sparkline(layer.counts)
    return (shown(layer.name), *numbers, missing, str(layer.infinite), bars)


def sparkline(counts: list[int]) -> str:
    """Return a character for each number, the higher the larger; only zeros are blank."""
    blocks = BLOCKS if can_print(BLOCKS) else ASCII_BLOCKS
    highest, steps = max(counts, default=0), len(blocks) - 1
    return "".join(blocks[-(-steps * count // highest)] if count else blocks[0] for count in counts)


def _print_histogram(layer: "LayerStatistics") -> None:
    if not layer.counts:
        return
    print(f"\n{shown(layer.name)}")
    block = BLOCKS[-1] if can_print(BLOCKS) else "#"
    highest = max(layer.counts)
    rows = [
        (number(low), "..", number(high), str(count), block * round(WIDTH * count / highest))
        for low, high, count in zip(layer.edges[:-1], layer.edges[1:], layer.counts, strict=True)
    ]
    print_table(rows, numbers=(0, 2, 3))
