# SPDX-License-Identifier: BSD-3-Clause
"""Node `rerun_viewer`: shows maps and other messages of a running system in Rerun."""

from functools import partial
from importlib import import_module

from rclpy.node import Node

from grid_map_core_py._packages import remedy_for
from grid_map_core_py.errors import required
from grid_map_ros_py.errors import NodeFailedError
from grid_map_ros_py.nodes import ConfiguredNode, read_parameter
from grid_map_ros_py.nodes._health import LogThrottle, health_of
from grid_map_ros_py.nodes._parameters import check_topic
from grid_map_ros_py.nodes._spin import steady_timer
from grid_map_ros_py.nodes._topics import LatchedSubscription

from .._rerun.live import QUEUES, LiveScene
from .._rerun.scene import SHOWN_TYPES, Style
from .._rerun.server import Server
from ..colors import DEFAULT_COLOR_MAP

TF = frozenset({"/tf", "/tf_static"})
"""Topics that are always shown, because the poses of other messages depend on them."""

PERIOD = 0.5
"""Time between checks for new topics and for the end of the Rerun process [s]."""


class RerunViewerNode(ConfiguredNode):
    """Node that forwards the requested topics, or all topics of supported types, to Rerun."""

    def __init__(self) -> None:
        super().__init__("rerun_viewer")
        about = (
            "topics to show, besides `/tf` and `/tf_static`; empty means all topics with supported "
            "types, including topics that appear later"
        )
        topics = read_parameter(self, "topics", list[str], [], description=about)
        self._chosen = {
            self.resolve_topic_name(check_topic(self, "topics", topic)) for topic in topics
        }
        about = "height layer; empty means `elevation`, or else the first layer of the map"
        height_layer = self.read("height_layer", "", about)
        about = (
            "initial color layer; a layer whose name ends in `color` is read as packed colors. "
            "If empty, the surface is colored by height"
        )
        color_layer = self.read("color_layer", "", about)
        about = "Matplotlib color map of `color_layer`; other layers use the default color map"
        color_map = self.read("color_map", DEFAULT_COLOR_MAP, about)
        about = "factor that scales heights in the 3-D view"
        exaggeration = self.read_positive("exaggeration", 1.0, about)
        about = (
            "maximum number of cells in a surface or image; larger maps are downsampled. "
            "0 means no limit"
        )
        max_drawn_cells = self.read("max_drawn_cells", 50_000, about)
        style = Style(
            height_layer=height_layer,
            color_layer=color_layer,
            color_map=color_map,
            exaggeration=exaggeration,
            max_drawn_cells=max_drawn_cells,
            max_image_cells=max_drawn_cells,
        )
        about = "maximum rate of a topic [Hz]; for faster topics, only the newest message is shown"
        max_rate = self.read_positive("max_rate", 5.0, about)
        self._log = LogThrottle(self.get_logger())
        self._has_shown = False
        self._followed: dict[str, LatchedSubscription | None] = {}
        self._server = self._serve()
        self._live = LiveScene(self._server.recording, style)
        health = health_of(self)
        health.inputs, live = "messages", self._live
        health.details = lambda: {"messages shown": live.shown, "messages replaced": live.replaced}
        steady_timer(self, 1 / max_rate, self._write)
        steady_timer(self, PERIOD, self._look)
        # Log the address on a line of its own, where it is easy to find and copy.
        self.get_logger().info(f"shows messages in the browser at\n{self._server.page_url}")

    def _serve(self) -> Server:
        about = "address of the page; `127.0.0.1` is reachable from this machine only"
        host = self.read("host", "127.0.0.1", about)
        port = self.read_number("port", 9876, 0, 65535, "port of the page; 0 means any free port")
        about = "maximum memory for the messages on the timeline, such as `512MB` or `10%`"
        memory_limit = self.read("memory_limit", "512MB", about)
        about = (
            "additional host names under which browsers may open the page. IP addresses, "
            "`localhost`, `host` and the machine name (also with `.local`) always work"
        )
        names = read_parameter(self, "allowed_hosts", list[str], [], description=about)
        required("rerun_cli", "rerun_viewer", f"{remedy_for('rerun')}, or use web_viewer")
        server = Server(host, port, memory_limit=memory_limit, allowed_hosts=names)
        if server.is_public:
            text = f"anyone who can reach {server.page_url} sees the messages, and can add others"
            self.get_logger().warning(text)
        return server

    def destroy_node(self) -> None:
        self._server.close()
        Node.destroy_node(self)

    def _put(self, topic: str, kind: str, data: bytes) -> None:
        self._live.put(topic, kind, data)
        health_of(self).defer()

    def _write(self) -> None:
        health = health_of(self)
        before = self._live.shown
        refusals = self._live.write()
        if self._live.shown > before:
            health.use(self._live.shown - before)
        for refusal in refusals:
            health.drop(refusal)
            self._log.error(f"dropped a message of {refusal}")
        health.problem = self._live.problem
        if health.problem:
            self._log.warning(health.problem)

    def _look(self) -> None:
        """Subscribe to new topics; raise `NodeFailedError` if Rerun has ended."""
        if self._server.problem:
            raise NodeFailedError(self._server.problem)
        for topic, types in self.get_topic_names_and_types():
            # The publishers determine the quality of service of the subscription.
            if topic not in self._followed and self.count_publishers(topic):
                self._follow(topic, types)
        if self._live.shown and not self._has_shown:
            self._has_shown = True
            # Repeat the address, because other nodes may have logged many lines since the start.
            self.get_logger().info(f"the first message is shown; see\n{self._server.page_url}")

    def _follow(self, topic: str, types: list[str]) -> None:
        kind = next((kind for kind in types if kind in SHOWN_TYPES), None)
        is_chosen = topic in self._chosen or (kind and not self._chosen) or topic in TF
        if not is_chosen:
            return
        self._followed[topic] = None
        if kind is None:
            self.get_logger().warning(f"{topic} is not shown: its type is {', '.join(types)}")
            return
        package, _, name = kind.split("/")
        try:
            message_type = getattr(import_module(f"{package}.msg"), name)
        except ImportError:
            self.get_logger().warning(f"{topic} is not shown: {package} is not installed")
            return
        self._followed[topic] = LatchedSubscription(
            self,
            message_type,
            topic,
            partial(self._put, topic, kind),
            raw=True,
            hears_best_effort=True,
            depth=QUEUES.get(kind, 1),
        )
        self.get_logger().info(f"shows {topic} ({kind})")


if __name__ == "__main__":
    raise SystemExit(RerunViewerNode.main())
