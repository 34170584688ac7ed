# SPDX-License-Identifier: BSD-3-Clause
"""Conversions and nodes with optional messages, such as those of Nav2, which are built here."""

import gzip
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from std_msgs.msg import Header

from grid_map_core_py import GridMap
from grid_map_core_py.testing import assert_maps_equal
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, from_octomap
from grid_map_ros_py.testing import Process, environment, peer, running, wait_until
from scratch import ROOT, run

pytestmark = pytest.mark.timeout(600)  # builds messages

NODE = "grid_map_ros_py._executables.octomap_to_grid_map"
DEMO = "grid_map_demos_py.octomap_to_gridmap_demo_node"
OCTOMAPS = ROOT / "grid_map_ros_py" / "test" / "data" / "octomaps.json.gz"
OCTOMAP = json.loads(gzip.decompress(OCTOMAPS.read_bytes()))["cases"][0]

INTERFACES = {
    "convex_plane_decomposition_msgs": {
        "msg/Point2d.msg": "float32 x\nfloat32 y\n",
        "msg/Polygon2d.msg": "Point2d[] points\n",
        "msg/PolygonWithHoles2d.msg": "Polygon2d outer_boundary\nPolygon2d[] holes\n",
        "msg/BoundingBox2d.msg": ("float32 min_x\nfloat32 min_y\nfloat32 max_x\nfloat32 max_y\n"),
        "msg/PlanarRegion.msg": (
            "geometry_msgs/Pose plane_parameters\nBoundingBox2d bbox2d\n"
            "PolygonWithHoles2d boundary\nPolygonWithHoles2d[] insets\n"
        ),
        "msg/PlanarTerrain.msg": ("PlanarRegion[] planar_regions\ngrid_map_msgs/GridMap gridmap\n"),
    },
    "map_msgs": {
        "msg/OccupancyGridUpdate.msg": (
            "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"
        ),
    },
    "nav2_msgs": {
        "msg/CostmapUpdate.msg": (
            "std_msgs/Header header\nuint32 x\nuint32 y\nuint32 size_x\nuint32 size_y\n"
            "uint8[] data\n"
        ),
        "action/ComputePathToPose.action": (
            "geometry_msgs/PoseStamped goal\ngeometry_msgs/PoseStamped start\nstring planner_id\n"
            "bool use_start\n---\nnav_msgs/Path path\nbuiltin_interfaces/Duration planning_time\n"
            "uint16 error_code\nstring error_msg\n---\n"
        ),
        "srv/IsPathValid.srv": (
            "nav_msgs/Path path\n---\nbool is_valid\nint32[] invalid_pose_indices\n"
        ),
        "srv/GetCostmap.srv": "nav2_msgs/CostmapMetaData specs\n---\nnav2_msgs/Costmap map\n",
        "msg/Costmap.msg": "std_msgs/Header header\nCostmapMetaData metadata\nuint8[] data\n",
        "msg/CostmapMetaData.msg": (
            "builtin_interfaces/Time map_load_time\nbuiltin_interfaces/Time update_time\n"
            "string layer\nfloat32 resolution\nuint32 size_x\nuint32 size_y\n"
            "geometry_msgs/Pose origin\n"
        ),
    },
    "octomap_msgs": {
        "msg/Octomap.msg": (
            "std_msgs/Header header\nbool binary\nstring id\nfloat64 resolution\nint8[] data\n"
        ),
        "srv/GetOctomap.srv": "---\noctomap_msgs/Octomap map\n",
    },
    "tf2_msgs": {"msg/TFMessage.msg": "geometry_msgs/TransformStamped[] transforms\n"},
}

TYPE_HASHES = {
    "map_msgs/msg/OccupancyGridUpdate": (
        "RIHS01_c4095b0be2e4363f8978a1570e0293ee093436f1e1c61d99b48502ac317025e8"
    ),
    "tf2_msgs/msg/TFMessage": (
        "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
    ),
}
"""Type hashes that Jazzy shows for messages of these types (`ros2 topic info --verbose`)."""

# Only what Python needs: all generators would take twice as long.
CMAKE = """
cmake_minimum_required(VERSION 3.8)
project({name})
foreach(package ament_cmake action_msgs builtin_interfaces geometry_msgs grid_map_msgs
        nav_msgs std_msgs rosidl_cmake rosidl_generator_c rosidl_typesupport_c
        rosidl_typesupport_fastrtps_c rosidl_generator_py)
  find_package(${{package}} REQUIRED)
endforeach()
list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX cpp)
rosidl_generate_interfaces({name} {files}
  DEPENDENCIES action_msgs builtin_interfaces geometry_msgs grid_map_msgs nav_msgs std_msgs)
ament_package()
"""

MANIFEST = """
<package format="3">
  <name>{name}</name>
  <version>0.1.0</version>
  <description>The fields of the messages of that name.</description>
  <maintainer email="nobody@example.com">nobody</maintainer>
  <license>BSD-3-Clause</license>
  <depend>action_msgs</depend>
  <depend>builtin_interfaces</depend>
  <depend>geometry_msgs</depend>
  <depend>grid_map_msgs</depend>
  <depend>nav_msgs</depend>
  <depend>std_msgs</depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""

TF2 = """
from tf2_msgs.msg import TFMessage
from grid_map_ros_py.nodes import map_qos

class TransformException(Exception):
    pass

class Buffer(dict):
    def lookup_transform(self, target, source, time):
        if (target, source) in self:
            return self[target, source]
        raise TransformException(f"{source!r} passed to lookupTransform does not exist")

class TransformListener:
    def __init__(self, buffer, node):
        self.buffer = buffer
        self.subscription = node.create_subscription(TFMessage, "/tf_static", self.add, map_qos())

    def add(self, message):
        for transform in message.transforms:
            self.buffer[transform.header.frame_id, transform.child_frame_id] = transform
"""
"""Stand-in for tf2 that knows single static transforms."""

OCTOMAP_SERVER = """
import array, sys, time
import rclpy
from octomap_msgs.msg import Octomap
from octomap_msgs.srv import GetOctomap
from grid_map_ros_py.nodes import map_qos

data, durability = sys.argv[1:]
rclpy.init()
node = rclpy.create_node("octomap_server")
octomap = Octomap(binary=True, id="OcTree", resolution=0.1)
octomap.header.frame_id = "world"
octomap.data = array.array("b", bytes.fromhex(data))
broken = Octomap(binary=True, id="OcTree", resolution=0.1, data=octomap.data[:-2])
qos = map_qos(transient_local=durability == "latched")
publisher = node.create_publisher(Octomap, "octomap_binary", qos)
publisher.publish(octomap)
turns = [broken, octomap]

def publish():
    publisher.publish(turns[0])
    turns.reverse()

def answer(request, response):
    response.map = octomap
    return response

if durability == "volatile":
    node.create_timer(0.2, publish)
node.create_service(GetOctomap, "get_octomap", answer)

def show(octomap):
    print(octomap.header.frame_id, octomap.data.tobytes().hex())

node.create_subscription(Octomap, "octomap", show, map_qos())
print("ready")
rclpy.spin(node)
"""


def write_package(folder: Path, name: str, files: dict[str, str]) -> None:
    for path, text in files.items():
        (folder / name / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / name / path).write_text(text)
    (folder / name / "package.xml").write_text(MANIFEST.format(name=name))
    cmake = CMAKE.format(name=name, files=" ".join(files))
    (folder / name / "CMakeLists.txt").write_text(cmake)


@pytest.fixture(scope="module")
def with_messages(tmp_path_factory) -> dict[str, str]:
    """Return the environment of processes that have the messages."""
    workspace = tmp_path_factory.mktemp("messages")
    for name, files in INTERFACES.items():
        write_package(workspace / "src", name, files)
    done = run("colcon", "build", "--base-paths", "src", environ=environment(), cwd=workspace)
    assert done.returncode == 0, done.stdout + done.stderr
    enter = ". install/local_setup.bash && env -0"
    done = run("bash", "-c", enter, environ=environment(), cwd=workspace)
    entries = (entry.partition("=") for entry in done.stdout.split("\0") if "=" in entry)
    return {name: value for name, _, value in entries}


@pytest.fixture
def expected() -> GridMap:
    octomap = SimpleNamespace(
        header=Header(frame_id="world"),
        binary=True,
        id="OcTree",
        resolution=0.1,
        data=bytes.fromhex(OCTOMAP["binary"]),
    )
    grid_map = from_octomap(octomap, "height", max_bound=(np.nan, np.nan, 0.4))
    grid_map.basic_layers = ["height"]
    return grid_map


@contextmanager
def octomap_server(environ: dict[str, str], durability: str) -> Iterator[Process]:
    command = [sys.executable, "-c", OCTOMAP_SERVER, OCTOMAP["binary"], durability]
    server = Process(command, environ)
    try:
        wait_until(lambda: "ready" in server.text or not server.is_running, "the octomap server")
        assert server.is_running, server.text
        yield server
    finally:
        server.stop()


def node(environ: dict[str, str], module: str = NODE, **parameters: object) -> Process:
    given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    return Process([sys.executable, "-m", module, "--ros-args", *given], environ)


@pytest.mark.parametrize("name", TYPE_HASHES)
def test_messages_have_the_type_hashes_of_jazzy(with_messages, name):
    package = name.partition("/")[0]
    prefixes = with_messages["AMENT_PREFIX_PATH"].split(os.pathsep)
    (prefix,) = (path for path in prefixes if Path(path).name == package)
    hashes = json.loads(Path(prefix, "share", f"{name}.json").read_text())["type_hashes"]
    (found,) = (entry["hash_string"] for entry in hashes if entry["type_name"] == name)
    assert found == TYPE_HASHES[name]


@pytest.mark.parametrize("file", ["costmaps.py", "plans.py", "terrains.py"])
def test_nodes_work_with_optional_messages(with_messages, tmp_path, file):
    (tmp_path / "tf2_ros.py").write_text(TF2)
    path = os.pathsep.join([str(tmp_path), with_messages["PYTHONPATH"]])
    environ = {**with_messages, "PYTHONPATH": path}
    done = run(sys.executable, "-m", "pytest", "-q", f"test/{file}", environ=environ)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("durability", ["latched", "volatile"])
def test_the_node_converts_the_octomaps_of_a_topic(with_messages, expected, durability):
    process = node(with_messages, layer="height", max_z=0.4)
    with octomap_server(with_messages, durability), running(process), peer() as listener:
        listener.listen("/grid_map", GridMapMessage)
        assert_maps_equal(from_message(listener.expect("/grid_map")), expected)
        if durability == "volatile":
            # Broken messages arrive in between; the node continues.
            text = "dropped a message of /octomap_binary: data: expected 1 more nodes of the tree"
            listener.wait_until(lambda: text in process.text, "a warning")
            listener.expect("/grid_map", len(listener.received["/grid_map"]) + 1)
            assert process.text.count(text) == 1


def test_the_node_asks_a_service_for_octomaps(with_messages, expected):
    parameters = {"octomap_service_topic": "/get_octomap", "octomap_service_period": 0.3}
    process = node(with_messages, layer="height", max_z=0.4, grid_map_topic="/map", **parameters)
    with running(process), peer() as listener:
        listener.listen("/map", GridMapMessage)
        listener.wait_until(lambda: "is not there" in process.text, "a warning")
        with octomap_server(with_messages, "latched"):
            assert_maps_equal(from_message(listener.expect("/map", 2)), expected)


def test_demo_republishes_the_octomap_of_a_service(with_messages, expected):
    process = node(with_messages, DEMO, octomap_service_topic="/get_octomap", max_z=0.4)
    with running(process), peer() as listener:
        listener.listen("/grid_map", GridMapMessage)
        listener.wait_until(lambda: "waiting for the service" in process.text, "its patience")
        with octomap_server(with_messages, "latched") as server:
            grid_map = from_message(listener.expect("/grid_map"))
            passed_on = f"world {OCTOMAP['binary']}\n"
            listener.wait_until(lambda: passed_on in server.text, "the octomap")
    assert (grid_map.geometry, grid_map.frame_id) == (expected.geometry, expected.frame_id)
    assert (grid_map.layers, grid_map.basic_layers) == (("elevation",), ("elevation",))
    np.testing.assert_array_equal(grid_map["elevation"], expected["height"])


@pytest.mark.parametrize("module", [NODE, DEMO])
def test_missing_octomap_msgs_is_named(tmp_path, module):
    (tmp_path / "octomap_msgs.py").write_text("raise ImportError")
    path = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    process = node({"PYTHONPATH": path}, module)
    assert process.wait() == 1
    (line,) = process.lines
    name = module.rpartition(".")[2].removesuffix("_node")
    assert f"{name} needs the package 'octomap_msgs', which is not installed: " in line
