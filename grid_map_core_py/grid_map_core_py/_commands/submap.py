# SPDX-License-Identifier: BSD-3-Clause
"""Cut a rectangle out of a map of any size."""

import argparse

from ._arguments import add_destination, add_layers, add_source
from ._maps import Destination
from ._tiles import add_rectangle, read_rectangle


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_source(parser)
    add_destination(parser)
    add_layers(parser, "cut this layer, instead of all")
    add_rectangle(parser, required=True)


def run(options: argparse.Namespace) -> int:
    destination = Destination(options)
    grid_map = read_rectangle(options, options.layers)
    destination.tell(destination.write([(None, grid_map)]))
    return 0
