# SPDX-License-Identifier: BSD-3-Clause
"""Node `web_viewer`: serves a web page that shows a map in the browser."""

import time

import numpy as np
from nav_msgs.msg import Path
from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from grid_map_core_py.errors import GridMapError, MissingPackageError
from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.messages._fields import check_finite
from grid_map_ros_py.nodes import ConfiguredNode, MapSubscription, read_parameter
from grid_map_ros_py.nodes._health import LogThrottle, health_of
from grid_map_ros_py.nodes._parameters import check_topic
from grid_map_ros_py.nodes._poses import TfPoses, has_tf
from grid_map_ros_py.nodes._spin import steady_timer
from grid_map_ros_py.nodes._topics import LatchedSubscription

from .._viewer.page import Page
from .._viewer.viewer import Viewer
from ..colors import DEFAULT_COLOR_MAP
from ..surface import check_max_drawn_cells

MAP_TYPE = "grid_map_msgs/msg/GridMap"

DEPTH = 10
"""Queue length of paths and markers; a marker usually adds to earlier markers."""

LOOK_PERIOD = 1.0
"""Time between two searches for map topics [s]."""


class WebViewerNode(ConfiguredNode):
    """Node that shows the grid maps of one topic, which the user selects on the web page."""

    def __init__(self) -> None:
        super().__init__("web_viewer")
        about = "initial map topic; other topics can be selected on the page"
        topic = self.resolve_topic_name(self.read_topic("grid_map_topic", "/grid_map", about))
        about = "maximum number of cells; larger maps are downsampled. 0 means no limit"
        max_drawn_cells = self.read("max_drawn_cells", 150_000, about)
        check_max_drawn_cells(max_drawn_cells)
        period = 1 / self.read_positive("update_rate", 20.0, "maximum update rate of the page [Hz]")
        self._robot_frame = self.read("robot_frame", "", "tf frame of the robot; empty means none")
        if self._robot_frame and not has_tf():
            remedy = "install tf2_ros_py of your ROS distribution, or leave it empty"
            raise MissingPackageError("tf2_ros", "robot_frame", remedy)
        about = "topic of a path in the map frame, drawn on the surface; empty means none"
        path_topic = self.read("path_topic", "/plan", about)
        about = (
            "topic of markers in the map frame, such as planar regions; lines and triangles are "
            "drawn. Empty means none"
        )
        marker_topic = self.read("marker_topic", "/planar_regions", about)
        about = "address of the page; `127.0.0.1` is reachable from this machine only"
        host = self.read("host", "127.0.0.1", about)
        port = self.read_number("port", 8080, 0, 65535, "port of the page; 0 means any free port")
        height_layer = self.read("height_layer", "elevation", "initial height layer")
        about = (
            "initial color layer; a layer whose name ends in `color` is read as packed colors. "
            "If empty, the surface is colored by height"
        )
        color_layer = self.read("color_layer", "", about)
        color_map = self.read("color_map", DEFAULT_COLOR_MAP, "initial Matplotlib color map")
        about = (
            "additional host names under which browsers may open the page. IP addresses, "
            "`localhost`, `host` and the machine name (also with `.local`) always work"
        )
        names = read_parameter(self, "allowed_hosts", list[str], [], description=about)
        self._page = Page(host, port, height_layer, color_layer, color_map, names, topic)
        if self._page.is_public:
            self.get_logger().warning(
                f"anyone who can reach {self._page.url} sees all maps and can change the settings"
            )
        clock = lambda: self.get_clock().now().nanoseconds  # noqa: E731
        self._viewer = Viewer(self._page, max_drawn_cells, clock)
        self._log = LogThrottle(self.get_logger())
        self._poses = TfPoses(self, self._robot_frame) if self._robot_frame else None
        self._next_look = 0.0
        self._subscribe(topic)
        self._drawings = [
            LatchedSubscription(self, kind, given, receive, depth=DEPTH, is_counted=False)
            for name, given, kind, receive in (
                ("path_topic", path_topic, Path, self._receive_path),
                ("marker_topic", marker_topic, MarkerArray, self._viewer.receive_markers),
            )
            if given and check_topic(self, name, given)
        ]
        steady_timer(self, period, self._update)

    def _subscribe(self, topic: str) -> None:
        self._topic, self._has_map = topic, False
        self._maps = MapSubscription(self, topic, self._receive)
        # Log the address on a line of its own, where it is easy to find and copy.
        text = f"shows {self._maps.topic_name} in the browser at\n{self._page.url}"
        self.get_logger().info(text)

    def destroy_node(self) -> None:
        self._page.close()
        Node.destroy_node(self)

    def _receive(self, received: ReceivedMap) -> None:
        self._viewer.receive(received)
        if not self._has_map:
            # Repeat the address, because other nodes may have logged many lines since the start.
            text = f"the first map of {self._maps.topic_name} has come; see\n{self._page.url}"
            self.get_logger().info(text)
        self._has_map = True

    def _receive_path(self, message: Path) -> None:
        places = [one.pose.position for one in message.poses]
        points = np.array([(place.x, place.y, place.z) for place in places]).reshape(-1, 3)
        check_finite("poses", points)
        self._viewer.receive_path(points, message.header.frame_id)

    def _update(self) -> None:
        if self._page.is_watched:
            if time.monotonic() >= self._next_look:
                self._next_look = time.monotonic() + LOOK_PERIOD
                topics = self.get_topic_names_and_types()
                self._page.offer_topics(name for name, types in topics if MAP_TYPE in types)
            if self._page.topic != self._topic:
                self._maps.destroy()
                self._viewer.clear()
                self._subscribe(self._page.topic)
            frame_id = self._viewer.frame_id
            if self._poses is not None and frame_id:
                to_robot = None
                try:
                    # The map frame may change; the robot frame is constant.
                    to_robot = self._poses.frame_at(frame_id, 0)
                except GridMapError as error:
                    self._log.warning(f"no pose of the robot: {error}")
                pose = None if to_robot is None else np.linalg.inv(to_robot)
                self._page.draw_frame("robot", self._robot_frame, pose)
        problem = health_of(self).problem = self._viewer.update()
        if problem:
            self._log.error(problem)


if __name__ == "__main__":
    raise SystemExit(WebViewerNode.main())
