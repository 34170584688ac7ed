# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `web_viewer`: serves a page that shows a map in the browser.

Parameters:
    grid_map_topic: maps come from here (`/grid_map`).
    host: address at which the page is served (`127.0.0.1`: for this machine alone).
    port: of that address (8080); 0 takes a free one.
    height_layer: the layer that gives the heights at first (`elevation`).
    color_layer: the layer that gives the colours at first; empty for that of the heights.
    color_map: the colour map at first (`viridis`).
    max_cells: larger maps are thinned out to so many cells (150000); 0 for never.
    update_rate: how often the page is brought up to date at most [Hz] (20.0).
"""

import sys

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from grid_map_core_py.config import check
from grid_map_ros_py.parameters import check_topic, read_parameter, read_positive
from grid_map_ros_py.spin import run
from grid_map_ros_py.subscription import MapSubscription
from grid_map_ros_py.throttle import LogThrottle

from .colormaps import DEFAULT_COLOR_MAP, Coloring, ColorScale
from .surface import check_max_cells
from .viewer.page import Page, is_loopback
from .viewer.settings import Settings
from .viewer.viewer import Viewer


class WebViewerNode(Node):
    """Hands maps over to a page."""

    def __init__(self) -> None:
        super().__init__("web_viewer")
        topic = read_parameter(self, "grid_map_topic", str, "/grid_map")
        check_topic(self, "grid_map_topic", topic)
        max_cells = _read_max_cells(self)
        period = 1 / read_positive(self, "update_rate", 20.0)
        self._page = _serve_page(self)
        self._viewer = Viewer(self._page, max_cells)
        self._throttle = LogThrottle()
        self._maps = MapSubscription(self, topic, self._viewer.receive)
        # The page lives on while a simulation is paused.
        self.create_timer(period, self._update, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f"shows {topic} at {self._page.url}")

    def destroy_node(self) -> None:
        """Give the node and its page up."""
        self._page.close()
        Node.destroy_node(self)

    def _update(self) -> None:
        problem = self._viewer.update()
        if problem and self._throttle.allow(problem):
            self.get_logger().error(problem)


def _read_max_cells(node: Node) -> int:
    max_cells = read_parameter(node, "max_cells", int, 150_000)
    check_max_cells(max_cells)
    return max_cells


def _serve_page(node: Node) -> Page:
    host = read_parameter(node, "host", str, "127.0.0.1")
    port = read_parameter(node, "port", int, 8080)
    check(0 <= port < 2**16, "port", "a number from 0 to 65535", port)
    scale = ColorScale(color_map=read_parameter(node, "color_map", str, DEFAULT_COLOR_MAP))
    coloring = Coloring(layer=read_parameter(node, "color_layer", str, ""), scale=scale)
    height_layer = read_parameter(node, "height_layer", str, "elevation")
    page = Page(host, port, Settings(height_layer=height_layer, coloring=coloring))
    if not is_loopback(host):
        node.get_logger().warning(
            f"everybody who reaches {page.url} sees the map and may change what is shown"
        )
    return page


def main() -> int:
    """Run the node until it is told to stop; return the exit code."""
    return run(WebViewerNode)


if __name__ == "__main__":
    sys.exit(main())
