# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Show a map in the browser, until Ctrl-C."""

import argparse
import time
import webbrowser
from types import SimpleNamespace

from grid_map_core_py.commands import (
    UsageError,
    add_source,
    complete_layers,
    completed,
    message,
    on_end,
    read_map,
)

from .plot import complete_color_maps, usual_layer


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `run` to a parser."""
    add_source(parser)
    add = parser.add_argument
    text = "layer of the heights (elevation, or the first layer)"
    completed(add("--layer", help=text), complete_layers)
    text = "layer of the colors (layer of the heights)"
    completed(add("--color-layer", default="", help=text), complete_layers)
    text = "color map of Matplotlib (%(default)s)"
    completed(add("--color-map", default="viridis", help=text), complete_color_maps)
    add("--max-drawn-cells", type=int, default=150_000, help="thin out larger maps; 0 for never")
    page = parser.add_argument_group("page")
    text = "address to serve at (%(default)s: this machine only)"
    page.add_argument("--host", default="127.0.0.1", help=text)
    text = "port of the page (%(default)s); 0 selects a free port"
    page.add_argument("--port", type=int, default=8080, help=text)
    text = "name of this machine in browsers, besides its usual ones; may be repeated"
    page.add_argument("--allowed-hosts", metavar="NAME", action="append", default=[], help=text)
    page.add_argument("--open", action="store_true", help="also open a browser")


def run(options: argparse.Namespace) -> int:
    """Serve the page until a signal ends it."""
    from grid_map_ros_py import ReceivedMap, to_serialized_message
    from grid_map_ros_py.nodes import LogThrottle

    from .._viewer.page import Page
    from .._viewer.viewer import Viewer
    from ..surface import check_max_drawn_cells

    if not 0 <= options.port < 2**16:
        raise UsageError(f"--port: expected a number from 0 to 65535, got {options.port}")
    check_max_drawn_cells(options.max_drawn_cells)
    came: list[int] = []
    on_end(lambda number, _: came.append(number))
    grid_map = read_map(options)
    layers = options.layer or usual_layer(grid_map), options.color_layer
    for name in filter(None, layers):
        grid_map[name]  # raises if the layer does not exist
    page = Page(options.host, options.port, *layers, options.color_map, options.allowed_hosts)
    if page.is_public:
        message(f"warning: anyone who can reach {page.url} sees the map")
    try:
        viewer = Viewer(page, options.max_drawn_cells)
        # The viewer expects messages, as received from topics.
        viewer.receive(ReceivedMap(to_serialized_message(grid_map)))
        print(page.url, flush=True)
        if options.open:
            webbrowser.open(page.url)
        log = LogThrottle(SimpleNamespace(warning=lambda text: message(f"warning: {text}")))
        told = ""
        # The user's choices on the page take effect within 0.05 s.
        while not came:
            time.sleep(0.05)
            problem = viewer.update()
            if problem and problem != told:
                message(f"error: {problem}")
            told = problem
            for refusal in page.take_refusals():
                log.warning(refusal)
            log.flush()
    finally:
        page.close()
    return 0
