# SPDX-License-Identifier: BSD-3-Clause
"""The `elevation_mapping` node as a process, over DDS."""

import array
import json
import math
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clouds import xyz_cloud
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Empty, Trigger
from test_node_costmap import set_parameters
from test_poses import pose

from conftest import call
from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.elevation import ElevationMapper
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_msgs.srv import GetGridMap, ProcessFile, SetGridMap
from grid_map_ros_py import from_message, load_from_bag, to_message
from grid_map_ros_py.messages import to_stamp
from grid_map_ros_py.messages._image import from_pixels
from grid_map_ros_py.nodes._poses import has_tf
from grid_map_ros_py.testing import Peer, Process, running_node, start_node, wait_until

MODULE = "grid_map_ros_py._executables.elevation_mapping"
RAW, FILTERED = "/elevation_mapping/elevation_map_raw", "/elevation_mapping/elevation_map"
SECOND = 1_000_000_000
SERVICES = {
    "get_submap": GetGridMap,
    "get_raw_submap": GetGridMap,
    "masked_replace": SetGridMap,
    "save_map": ProcessFile,
    "load_map": ProcessFile,
    "clear_map": Empty,
    "trigger_fusion": Empty,
    "disable_updates": Empty,
    "enable_updates": Empty,
    "reload_parameters": Trigger,
}
BASE = {
    "map_frame_id": "odom",
    "length_in_x": 4,
    "length_in_y": 3.0,
    "resolution": 0.1,
    "pose_source": "topic",
    "robot_pose_with_covariance_topic": "/odom",
    "pose_type": "odometry",
    "min_update_rate": 20.0,
}
LIDAR = {
    "topic": "/points",
    "sensor_xyz": [0.0, 0.0, 1.0],
    "sensor_processor": {"type": "laser", "min_radius": 0.02},
}


def options(folder: Path, sources: dict[str, Any] | None = None, **parameters: Any) -> list[str]:
    """Return arguments with a parameter file, which only its heading tells from one of ROS 1."""
    values = {**BASE, "input_sources": {"lidar": LIDAR} if sources is None else sources}
    return write(folder, {**values, **parameters})


def write(folder: Path, parameters: dict[str, Any]) -> list[str]:
    path = folder / "mapping.yaml"
    content = {"elevation_mapping": {"ros__parameters": parameters}}
    # JSON is YAML without aliases, which ROS refuses.
    path.write_text(json.dumps(content))
    return ["--ros-args", "--params-file", str(path)]


class Robot:
    """Publishes poses, and scans of a ground whose height is that of `ground`."""

    def __init__(self, other: Peer) -> None:
        self.peer = other
        other.listen(RAW, GridMapMessage)
        other.listen(FILTERED, GridMapMessage)

    def drive(self, seconds: float, x: float = 0.0, frame: str = "odom") -> None:
        message = pose(seconds, x, kind=Odometry, frame_id=frame)
        message.pose.covariance = np.diag([1e-6] * 6).ravel()
        self.peer.publish("/odom", message, 10)

    def scan(self, seconds: float, ground: float = 0.0, frame: str = "lidar") -> None:
        self.peer.publish("/points", cloud(seconds, ground, frame), qos_profile_sensor_data)

    def until_mapped(self, seconds: float, ground: float = 0.0, x: float = 0.0) -> GridMap:
        """Drive and scan until a map of that time comes; the first messages may get lost."""

        def step() -> bool:
            if not self.maps() or self.maps()[-1].timestamp != round(seconds * SECOND):
                self.drive(seconds, x)
                self.scan(seconds, ground)
                self.peer.spin(0.1)
                return False
            return True

        self.peer.wait_until(step, f"a map of {seconds} s")
        return self.maps()[-1]

    def maps(self, topic: str = RAW) -> list[GridMap]:
        return [from_message(message) for message in self.peer.received[topic][-1:]]

    def until(self, condition: Any, what: str, topic: str = RAW) -> GridMap:
        self.peer.wait_until(lambda: self.maps(topic) and condition(self.maps(topic)[-1]), what)
        return self.maps(topic)[-1]

    def call(self, name: str, **request: Any) -> Any:
        return call(self.peer, SERVICES[name], f"/elevation_mapping/{name}", **request)


def cloud(seconds: float, ground: float = 0.0, frame: str = "lidar") -> PointCloud2:
    """Return points in all cells up to 1 m from the robot, seen from 1 m above it."""
    axis = np.arange(-0.95, 1, 0.1)
    points = [(x, y, ground - 1.0) for x in axis for y in axis]
    message = xyz_cloud(points, frame)
    message.header.stamp = to_stamp(round(seconds * SECOND))
    return message


@pytest.fixture
def robot(other_side: Peer) -> Robot:
    return Robot(other_side)


def known(grid_map: GridMap) -> int:
    return int(np.isfinite(grid_map["elevation"]).sum())


def details(other: Peer) -> dict[str, str]:
    (status,) = other.expect("/diagnostics").status
    return {value.key: value.value for value in status.values}


# --- sensors --------------------------------------------------------------------------------------


def camera_message(kind: type, **fields: Any) -> Any:
    message = kind(**fields)
    message.header.frame_id, message.header.stamp = "camera", to_stamp(2 * SECOND)
    return message


def test_lidar_depth_camera_and_colors_share_one_map(robot: Robot, tmp_path: Path) -> None:
    # Both cameras look down from 1 m; up in their images is +x.
    down = {"sensor_xyz": [0.0, 0.0, 1.0], "sensor_rpy": [math.pi, 0.0, -math.pi / 2]}
    info = camera_message(CameraInfo, height=40, width=40)
    info.k = np.array([40.0, 0, 19.5, 0, 40.0, 19.5, 0, 0, 1])
    header = camera_message(Image).header
    depths = from_pixels(np.full((40, 40), 700, np.uint16), "16UC1", header)
    colors = from_pixels(np.full((40, 40, 3), (0, 0, 255), np.uint8), "bgr8", header)
    sources = {
        "lidar": LIDAR,
        "depth": {
            "type": "depth_image",
            "topic": "/depth/image",
            "sensor_processor": {"type": "perfect"},
            **down,
        },
        "color": {
            "type": "image",
            "topic": "/color/image",
            "camera_info_topic": "/depth/camera_info",
            **down,
        },
    }
    with running_node(MODULE, *options(tmp_path, sources, conflict_points=1)) as node:
        robot.peer.wait_until(
            lambda: "poses: topic" in node.text or not node.is_running, "the node"
        )
        assert "maps /color/image, /depth/image, /points" in node.text
        lidar = robot.until_mapped(1.0)
        assert known(lidar) == 400
        assert lidar.layers[:3] == ("elevation", "variance", "time")

        def show() -> None:
            robot.drive(2.0)
            robot.peer.publish("/depth/camera_info", info, 10)
            robot.peer.publish("/depth/image", depths, qos_profile_sensor_data)
            robot.peer.publish("/color/image", colors, qos_profile_sensor_data)
            robot.peer.spin(0.1)

        def is_seen(grid_map: GridMap) -> bool:
            show()
            return "color" in grid_map and bool(np.nanmax(grid_map["elevation"]) > 0.2)

        both = robot.until(is_seen, "a map with colors and a plateau")
        heights = both["elevation"]
        # The depth camera sees 0.35 m to each side at its depth.
        assert both.at_position("elevation", (0.05, 0.05)) == pytest.approx(0.3, abs=0.01)
        assert both.at_position("elevation", (0.75, 0.05)) == pytest.approx(0.0, abs=0.01)
        assert np.isfinite(heights).sum() == 400
        red = both["color"][np.isfinite(both["color"])].view(np.uint32)
        assert set(red.tolist()) == {0xFF0000}


# --- services -------------------------------------------------------------------------------------

PIPELINE = {
    "filter1": {
        "name": "double",
        "type": "gridMapFilters/MathExpressionFilter",
        "params": {"expression": "2 * elevation", "output_layer": "twice"},
    }
}


def test_services_change_ask_save_and_load_the_map(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    arguments = options(
        tmp_path,
        postprocessor_pipeline=PIPELINE,
        fused_map_publishing_rate=0.0,
        directory=str(tmp_path / "maps"),
    )
    with running_node(MODULE, *arguments) as node:
        assert robot.call("get_submap").map.layers == [
            "elevation",
            "variance",
            "time",
            "upper_bound",
            "lower_bound",
            "twice",
        ]
        robot.until_mapped(1.0, ground=0.5)
        part = robot.call("get_raw_submap", length_x=0.5, length_y=0.5, layers=["elevation"]).map
        assert from_message(part).size == (6, 6)
        assert robot.call("get_raw_submap", frame_id="base").map.layers == []
        reason = "frame_id: expected 'odom', that of the map, got 'base'"
        wait_until(lambda: reason in node.text, "the reason in the log")

        # Only the service publishes the filtered map.
        assert robot.peer.received[FILTERED] == robot.peer.received[FILTERED][:1]
        robot.call("trigger_fusion")
        twice = robot.until(lambda m: known(m) == 400, "the filtered map", FILTERED)
        assert np.nanmax(twice["twice"]) == pytest.approx(1.0)

        patch = GridMap((0.4, 0.4), 0.1, layers={"elevation": 2.0, "mask": 1.0}, frame_id="odom")
        patch["mask"][0, :] = math.nan
        robot.call("masked_replace", map=to_message(patch))
        changed = robot.until(lambda m: np.nanmax(m["elevation"]) == 2.0, "the patch")
        assert int((changed["elevation"] == 2.0).sum()) == 12

        assert robot.call("save_map", file_path="first").success
        assert load_from_bag(tmp_path / "maps" / "first", "/elevation_map").layers[-1] == "twice"
        assert not robot.call("save_map", file_path="../second").success
        assert not robot.call("save_map", file_path="second", topic_name="/map").success
        robot.call("clear_map")
        robot.until(lambda m: known(m) == 0, "an empty map")
        assert not robot.call("load_map", file_path="second").success
        assert robot.call("load_map", file_path="first").success
        loaded = robot.until(lambda m: known(m) == 400, "the loaded map")
        np.testing.assert_array_equal(loaded["elevation"], changed["elevation"])

        robot.call("disable_updates")
        robot.drive(2.0)
        robot.scan(2.0, ground=9.0)
        robot.call("enable_updates")
        assert robot.until_mapped(3.0, 0.5).timestamp == 3 * SECOND
        assert "9.0" not in str(np.nanmax(robot.maps()[-1]["elevation"]))

        changed = partial(set_parameters, robot.peer, node="elevation_mapping")
        assert changed(max_variance=1e-12) == []
        answer = robot.call("reload_parameters")
        assert not answer.success
        assert "'max_variance': expected at least min_variance" in answer.message
        assert changed(max_variance=1e-5) == []
        assert robot.call("reload_parameters").success
        robot.until_mapped(4.0, 0.5)
        assert changed(resolution=0.2) != []
        assert [name for name in ("save_map", "load_map") if f"{name}: " not in node.text] == []


def test_few_used_points_are_explained(robot: Robot, tmp_path: Path) -> None:
    noisy = {"type": "laser", "min_radius": 9.0}
    sources = {
        "far": {"topic": "/far", "max_range": 0.5},
        "noisy": {"topic": "/noisy", "sensor_processor": noisy},
        "millimeters": {"topic": "/depth/image", "type": "depth_image"},
        "zeros": {"topic": "/zeros"},
        "empty": {"topic": "/empty"},
    }
    info = CameraInfo(height=4, width=4, k=np.array([4.0, 0, 1.5, 0, 4.0, 1.5, 0, 0, 1]))
    zeros, empty = (xyz_cloud([(0.0, 0.0, 0.0)] * 3, "odom") for _ in range(2))
    empty.data, empty.width, empty.row_step = array.array("B"), 0, 0
    depths = from_pixels(np.full((4, 4), 700, np.float32), "32FC1", zeros.header)
    scans = {"/far": cloud(7.0, frame="odom"), "/depth/image": depths, "/zeros": zeros}
    scans |= {"/noisy": scans["/far"], "/empty": empty, "/depth/camera_info": info}
    expected = [
        "/far: few points: used 0 of 400 points because 400 are farther than max_range",
        "/noisy: few points: used 0 of 400 points because 400 are in cells more uncertain than max",
        "/depth/image: few points: used 0 of 16 points because 16 are outside the map. The median",
        "/zeros: few points: used 0 of 3 points because 3 are not finite, or at the origin",
        "/empty: few points: used 0 of 0 points because the message is empty. Check the sensor",
    ]
    robot.peer.listen("/diagnostics", DiagnosticArray, 10)
    with running_node(MODULE, *options(tmp_path, sources, pose_source="none")) as node:

        def is_explained() -> bool:
            for topic, message in scans.items():
                robot.peer.publish(topic, message, qos_profile_sensor_data)
            return all(text in node.text for text in expected)

        robot.peer.wait_until(is_explained, "the reasons")
        robot.peer.received["/diagnostics"].clear()
        (status,) = robot.peer.expect("/diagnostics").status
        assert (status.level, expected[0] in status.message) == (DiagnosticStatus.WARN, True)


def test_missing_messages_name_topics_types_and_remedies(robot: Robot, tmp_path: Path) -> None:
    sources = {
        "lidar": LIDAR,
        "rear": {"topic": "/scan"},
        "depth": {"topic": "/depth/image", "type": "depth_image"},
    }
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    expected = [
        "it waited 0.2 s for poses on /odom (type nav_msgs/msg/Odometry, but the parameters ask fo"
        f"r {kind})" + "; without tf2_ros_py, pose_source 'auto' means" * (not has_tf()),
        "no messages of rear on /scan (no publisher; topics of type sensor_msgs/msg/PointCloud2: /",
        "image, on /depth/camera_info (no publisher; did you mean /depth/camera_inf?)",
    ]
    robot.peer.node.create_publisher(Odometry, "/odom", 10)
    robot.peer.node.create_publisher(Odometry, "/depth/camera_inf", 10)
    image = from_pixels(np.ones((4, 4), np.float32), "32FC1", camera_message(Image).header)
    parameters = {"pose_type": "pose_with_covariance", "pose_timeout": 0.2}
    with running_node(MODULE, *options(tmp_path, sources, **parameters)) as node:

        def is_explained() -> bool:
            robot.scan(1.0)
            robot.peer.publish("/depth/image", image, qos_profile_sensor_data)
            return all(text in node.text for text in expected)

        robot.peer.wait_until(is_explained, "the reasons")
        assert "ERROR" not in node.text


LASER = {"type": "laser"}


@pytest.mark.parametrize(
    ("sources", "text"),
    [
        ([], "maps nothing"),
        (
            {
                "a": {**LIDAR, "topic": "/a"},
                "b": {"type": "image", "topic": "/b", "sensor_processor": LASER},
            },
            "?); input_sources.b.sensor_processor (images have no noise); sensor_processor (no sou",
        ),
    ],
)
def test_parameters_without_effect_are_named(
    robot: Robot, tmp_path: Path, sources: Any, text: str
) -> None:
    given = {"sensor_processor": LASER, "robot_motion_map_update": {"scale": 2.0}}
    with running_node(MODULE, *options(tmp_path, sources, **given)) as node:
        robot.peer.wait_until(lambda: "poses: " in node.text, "the node")
        assert text in node.text
        motion = "effect: robot_motion_map_update.scale (unknown; did you mean robot_motion_map_up"
        assert motion in node.text


# --- what gets lost, rates, names of ROS 1 --------------------------------------------------------


def test_lost_poses_bad_clouds_and_a_looping_bag_are_survived(robot: Robot, tmp_path: Path) -> None:
    lidar = {**LIDAR, "sensor_processor": {"type": "constant"}, "max_range": 1.3}
    arguments = options(tmp_path, {"lidar": lidar}, use_sim_time=True, pose_timeout=0.2)
    robot.peer.listen("/diagnostics", DiagnosticArray, 10)

    def lines(node: Process, text: str) -> int:
        return sum(text in line for line in node.lines)

    with running_node(MODULE, *arguments) as node:
        # Simulated time stands still: nobody publishes /clock.
        robot.until_mapped(100.0, x=1.0)
        for k in range(10):
            robot.scan(101.0 + k)
        robot.peer.wait_until(lambda: lines(node, "a later pose than that of"), "lost poses")
        for k in range(10):
            bad = cloud(100.0)
            bad.data = bad.data[: -k - 1]
            robot.peer.publish("/points", bad, qos_profile_sensor_data)
            robot.drive(100.0, frame="map")
        robot.peer.wait_until(lambda: lines(node, "dropped a cloud of lidar: data: "), "bad clouds")
        robot.peer.wait_until(lambda: lines(node, "dropped a pose: header.frame_id"), "bad poses")
        robot.peer.publish("/points", cloud(0.0), qos_profile_sensor_data)
        robot.peer.wait_until(lambda: lines(node, "dropped a cloud of lidar: header.stamp"), "time")
        robot.scan(100.0, frame="a_optical_frame")
        robot.peer.wait_until(lambda: lines(node, "got 'a_optical_frame' with z up"), "the axes")
        # The bag begins again.
        grid_map = robot.until_mapped(5.0, ground=0.2)
        assert grid_map.position.tolist() == [0.0, 0.0]
        assert grid_map.at_position("elevation", (-0.5, 0.5)) == pytest.approx(0.2, abs=0.01)
        robot.peer.wait_until(lambda: lines(node, "clock restarts"), "a warning of the reset")
        robot.until_mapped(6.0, ground=0.2)
        # No sensor any more.
        robot.peer.wait_until(lambda: lines(node, "no messages of lidar on /points"), "silence")
        for text in ("a later pose than", "lidar: data: ", "a pose: header", "clock restarts"):
            assert 1 <= lines(node, text) <= 3, text
        found = details(robot.peer)
        assert int(found["scans dropped"]) >= 10
        total = sum(int(found[f"scans {what}"]) for what in ("out", "dropped"))
        assert int(found["scans in"]) == total
        assert float(found["mean ms update"]) > 0
        lost = int(found["points dropped in the last scan: farther than max_range"])
        assert int(found["points dropped in the last scan"]) == lost > 0
        assert int(found["points used in the last scan"]) == 400 - lost > 200


def test_timers_publish_maps_also_to_late_subscribers(robot: Robot, tmp_path: Path) -> None:
    quiet = {**LIDAR, "publish_on_update": False}
    patch = {
        "initialize_elevation_map": True,
        "length_in_x_init_submap": 1.0,
        "length_in_y_init_submap": 0.6,
        "init_submap_height_offset": -0.1,
    }
    arguments = options(
        tmp_path, {"lidar": quiet}, min_update_rate=2.0, fused_map_publishing_rate=1.0, **patch
    )
    with running_node(MODULE, *arguments):
        robot.peer.wait_until(lambda: robot.drive(0.5, 0.3) or robot.maps(), "a map")
        begun = robot.until(known, "the patch")
        assert (known(begun), np.nanmax(begun["elevation"])) == (60, np.float32(-0.1))
        robot.until_mapped(1.0)
        robot.until(lambda m: m.timestamp == SECOND, "the filtered map", FILTERED)
        # A late subscriber gets the map of now, though nothing changes.
        robot.peer.received["late"] = []
        late = robot.peer.node.create_subscription(
            GridMapMessage, RAW, robot.peer.received["late"].append, 10
        )
        robot.peer.wait_until(lambda: robot.peer.received["late"], "a map for a late subscriber")
        robot.peer.node.destroy_subscription(late)


def test_files_of_this_package_start_the_node() -> None:
    files = sorted((Path(__file__).parents[1] / "config").glob("elevation_mapping_*.yaml"))
    assert len(files) == 3
    with ExitStack() as stack:
        nodes = [
            stack.enter_context(running_node(MODULE, "--ros-args", "--params-file", str(file)))
            for file in files
        ]
        for node in nodes:
            wait_until(lambda node=node: "poses: " in node.text or not node.is_running, "a node")
            assert "maps /" in node.text, node.text
            # Neither an unknown one nor one without effect.
            assert "parameter" not in node.text, node.text


@pytest.mark.needs("numba")
def test_node_says_that_it_compiles_if_it_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "[elevation_mapping]: numba compiles loops once"
    ElevationMapper(GridGeometry((1.0, 1.0), 0.1))
    with running_node(MODULE, *options(tmp_path)) as node:
        wait_until(lambda: "poses: " in node.text, "the node")
        assert text not in node.text
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    process = start_node(MODULE, *options(tmp_path))
    try:
        wait_until(lambda: text in process.text, "the news")
    finally:
        process.stop()


def test_file_of_ros_1_works_below_another_heading(robot: Robot, tmp_path: Path) -> None:
    parameters = {
        "point_cloud_topic": "/points",
        "map_frame_id": "/odom",
        "robot_base_frame_id": "/base",
        "track_point_frame_id": "/base",
        "track_point_x": 0.5,
        "robot_pose_with_covariance_topic": "/odom",
        "robot_pose_cache_size": 200,
        "length_in_x": 4.0,
        "length_in_y": 3.0,
        "resolution": 0.1,
        "max_variance": 10000,
        "surface_normal_positive_axis": "z",
        "relocate_rate": 3.0,
        "sensor_processor/type": "laser",
        "sensor_processor/min_radius": 0.018,
        "sensor_processor/ignore_points_above": 0.4,
        "robot_motion_map_update/covariance_scale": 0.01,
        # Where tf2 is not installed, this is what has to be added.
        "pose_source": "topic",
        "pose_type": "odometry",
    }
    with running_node(MODULE, *write(tmp_path, parameters)) as node:
        # The lidar is at the robot here.
        grid_map = robot.until_mapped(1.0, ground=1.2)
        assert known(grid_map) == 400
        assert grid_map.position.tolist() == [0.5, 0.0]
        robot.scan(1.0, ground=1.9)
        text = "parameters without effect: relocate_rate (the map moves with every scan); surf"
        assert text in node.text
        assert "unknown" not in node.text
        assert known(robot.until_mapped(2.0, ground=1.2)) == 400
        assert np.nanmax(robot.maps()[-1]["elevation"]) == pytest.approx(0.2, abs=0.01)
