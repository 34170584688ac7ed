# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `web_viewer`: serves a page that shows a map in the browser."""

from rclpy.node import Node

from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.nodes import (
    ConfiguredNode,
    LogThrottle,
    MapSubscription,
    health_of,
    read_parameter,
    return_memory,
    steady_timer,
)

from .._viewer.page import Page
from .._viewer.viewer import Viewer
from ..colors import DEFAULT_COLOR_MAP
from ..surface import check_max_drawn_cells


class WebViewerNode(ConfiguredNode):
    """Passes maps from a topic to the page."""

    def __init__(self) -> None:
        super().__init__("web_viewer")
        return_memory()
        topic = self.read_topic("grid_map_topic", "/grid_map", "topic of the maps")
        about = "limit of the cells, to which larger maps are thinned out; 0 for no limit"
        max_drawn_cells = self.read("max_drawn_cells", 150_000, about)
        check_max_drawn_cells(max_drawn_cells)
        about = "largest rate at which the page is updated [Hz]"
        period = 1 / self.read_positive("update_rate", 20.0, about)
        self._page = self._serve_page()
        self._viewer = Viewer(self._page, max_drawn_cells, health_of(self).drop_used)
        self._log = LogThrottle(self.get_logger())
        self._has_map = False
        self._maps = MapSubscription(self, topic, self._receive)
        steady_timer(self, period, self._update)
        # The address stands alone on its line, so that it is easy to find and to copy.
        text = f"shows {self._maps.topic_name} in the browser at\n{self._page.url}"
        self.get_logger().info(text)

    def _serve_page(self) -> Page:
        about = "address of the page; `127.0.0.1` is reachable from this machine only"
        host = self.read("host", "127.0.0.1", about)
        port = self.read_number("port", 8080, 0, 65535, "port of the page; 0 for any free one")
        height_layer = self.read("height_layer", "elevation", "initial layer of the heights")
        about = "initial layer of the colors, packed if its name ends in `color`; empty: heights"
        color_layer = self.read("color_layer", "", about)
        about = "initial color map, a name of Matplotlib"
        color_map = self.read("color_map", DEFAULT_COLOR_MAP, about)
        about = (
            "names under which browsers may open the page, besides IP addresses, `localhost`, "
            "`host` and the name of the machine, with or without `.local`"
        )
        names = read_parameter(self, "allowed_hosts", list[str], [], description=about)
        page = Page(host, port, height_layer, color_layer, color_map, names)
        if page.is_public:
            self.get_logger().warning(
                f"anyone who can reach {page.url} sees the map and can change the settings"
            )
        return page

    def destroy_node(self) -> None:
        """Destroy the node and close its page."""
        self._page.close()
        Node.destroy_node(self)

    def _receive(self, received: ReceivedMap) -> None:
        self._viewer.receive(received)
        if not self._has_map:
            # By now all nodes have started, and the address stands at the end of what they log.
            text = f"the first map of {self._maps.topic_name} has come; see\n{self._page.url}"
            self.get_logger().info(text)
        self._has_map = True

    def _update(self) -> None:
        problem = health_of(self).problem = self._viewer.update()
        if problem:
            self._log.error(problem)
        for refusal in self._page.take_refusals():
            self._log.warning(refusal)


if __name__ == "__main__":
    raise SystemExit(WebViewerNode.main())
