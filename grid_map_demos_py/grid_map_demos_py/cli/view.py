# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map view`: a map in the browser, without a ROS graph."""

import argparse
import signal
import time
import webbrowser
from types import FrameType
from typing import TYPE_CHECKING, Any

from .arguments import (
    add_choice_of_map,
    add_source,
    complete_color_maps,
    complete_layers,
    completed,
)
from .errors import CommandError, UsageError
from .formats import Format, format_of_source
from .output import message

if TYPE_CHECKING:
    from grid_map_ros_py import ReceivedMap
    from grid_map_visualization_py.viewer.page import Page
    from grid_map_visualization_py.viewer.viewer import Viewer

HELP = "show a map in the browser, until Ctrl-C"

_PERIOD = 0.05
"""Seconds between two looks at what somebody has chosen on the page."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what `run` needs."""
    add_source(parser)
    add_choice_of_map(parser)
    completed(
        parser.add_argument("--layer", help="of the heights (elevation, or the first)"),
        complete_layers,
    )
    completed(
        parser.add_argument("--color-layer", default="", help="of the colours (the heights)"),
        complete_layers,
    )
    completed(
        parser.add_argument("--color-map", default="viridis", help="of Matplotlib (%(default)s)"),
        complete_color_maps,
    )
    parser.add_argument(
        "--max-cells", type=int, default=150_000, help="thin out larger maps; 0 for never"
    )
    page = parser.add_argument_group("page")
    page.add_argument(
        "--host", default="127.0.0.1", help="address to serve at (%(default)s: this machine alone)"
    )
    page.add_argument("--port", type=int, default=8080, help="(%(default)s); 0 takes a free one")
    page.add_argument("--open", action="store_true", help="open a browser, too")


def run(options: argparse.Namespace) -> int:
    """Serve the page until somebody ends it."""
    from grid_map_visualization_py.surface import check_max_cells
    from grid_map_visualization_py.viewer.viewer import Viewer

    if not 0 <= options.port < 2**16:
        raise UsageError(f"--port: expected a number from 0 to 65535, got {options.port}")
    check_max_cells(options.max_cells)
    stop = _Stop()
    received = _received(options)
    page = _page(options, received.layers)
    try:
        viewer = Viewer(page, options.max_cells)
        viewer.receive(received)
        print(page.url, flush=True)
        if options.open:
            webbrowser.open(page.url)
        _serve(viewer, stop)
    finally:
        page.close()
    return 0


class _Stop:
    """Whether somebody has told the process to end."""

    def __init__(self) -> None:
        self.has_come = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._take_note)

    def _take_note(self, _number: int, _frame: FrameType | None) -> None:
        self.has_come = True


def _received(options: argparse.Namespace) -> "ReceivedMap":
    """Return the map as the viewer takes it from topics."""
    from grid_map_ros_py import ReceivedMap, to_serialized_message
    from grid_map_ros_py.bags import BagReader

    from .reading import read_map

    if format_of_source(options.source) is Format.BAG:
        with BagReader(options.source, options.topic) as bag:
            return ReceivedMap(bag[-1 if options.index is None else options.index].data)
    return ReceivedMap(
        to_serialized_message(read_map(options.source, options.topic, options.index))
    )


def _page(options: argparse.Namespace, layers: tuple[str, ...]) -> "Page":
    from grid_map_visualization_py.colors import Coloring, ColorScale
    from grid_map_visualization_py.viewer.page import Page, is_loopback
    from grid_map_visualization_py.viewer.settings import Settings, follow

    for name in filter(None, (options.layer, options.color_layer)):
        _check_layer(name, layers)
    if not layers:
        raise CommandError(f"{options.source}: the map has no layers")
    height_layer = options.layer or follow("elevation", layers)
    scale = ColorScale(color_map=options.color_map)
    mode: Any = "color" if options.color_layer.endswith("color") else "intensity"
    coloring = Coloring(mode=mode, layer=options.color_layer, scale=scale)
    settings = Settings(height_layer=height_layer, coloring=coloring)
    page = Page(options.host, options.port, settings)
    if not is_loopback(options.host):
        message(f"warning: everybody who reaches {page.url} sees the map")
    return page


def _check_layer(name: str, layers: tuple[str, ...]) -> None:
    if name not in layers:
        from grid_map_core_py import LayerNotFoundError

        raise LayerNotFoundError(name, layers)


def _serve(viewer: "Viewer", stop: _Stop) -> None:
    """Bring the page up to date again and again."""
    said = ""
    while not stop.has_come:
        problem = viewer.update()
        if problem and problem != said:
            message(f"error: {problem}")
        said = problem
        time.sleep(_PERIOD)
