# SPDX-License-Identifier: BSD-3-Clause
"""Pages on migration: new names exist, old names do not, and bags of ROS 1 convert."""

import pkgutil
import re
import shlex
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pages import page, table
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from grid_map_core_py import Polygon
from grid_map_ros_py import BagError, load_from_bag
from grid_map_ros_py.testing import environment
from scratch import run

DEFINITIONS = {
    "grid_map_msgs/msg/GridMapInfo": (
        "std_msgs/Header header\nfloat64 resolution\nfloat64 length_x\nfloat64 length_y\n"
        "geometry_msgs/Pose pose\n"
    ),
    "grid_map_msgs/msg/GridMap": (
        "grid_map_msgs/GridMapInfo info\nstring[] layers\nstring[] basic_layers\n"
        "std_msgs/Float32MultiArray[] data\nuint16 outer_start_index\nuint16 inner_start_index\n"
    ),
}
"""Message definitions of ROS 1, where the header is part of the info."""

TIME = "builtin_interfaces/msg/Time"
"""Full name of the type; std_msgs has another `Time`."""


@pytest.fixture
def bag(tmp_path) -> Path:
    """A bag of ROS 1 with a map of 3 x 2 cells that has moved by a row."""
    store = get_typestore(Stores.ROS1_NOETIC)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    made = SimpleNamespace(**{name.rpartition("/")[2]: cls for name, cls in store.types.items()})
    dimensions = [made.MultiArrayDimension("column_index", 2, 6)]
    dimensions.append(made.MultiArrayDimension("row_index", 3, 3))
    layout = made.MultiArrayLayout(dimensions, 0)
    header = made.Header(seq=3, stamp=store.types[TIME](5, 7), frame_id="odom")
    pose = made.Pose(made.Point(1.0, 2.0, 0.0), made.Quaternion(0.0, 0.0, 0.0, 1.0))
    message = made.GridMap(
        info=made.GridMapInfo(header, 0.5, 1.5, 1.0, pose),
        layers=["elevation"],
        basic_layers=[],
        data=[made.Float32MultiArray(layout, np.arange(6, dtype=np.float32))],
        outer_start_index=1,
        inner_start_index=0,
    )
    with Writer(tmp_path / "survey.bag") as writer:
        connection = writer.add_connection("/grid_map", message.__msgtype__, typestore=store)
        data = store.serialize_ros1(message, message.__msgtype__)
        writer.write(connection, 5_000_000_007, data)
    return tmp_path / "survey.bag"


def test_converted_bag_of_ros_1_is_read(bag):
    block = next(b for b in page("docs/migration_ros1.md").blocks if "rosbags" in b.text)
    program, *arguments = shlex.split(block.text)
    assert program == "rosbags-convert"
    start = "from rosbags.convert.cli import main; main()"
    done = run(sys.executable, "-c", start, *arguments, environ=environment(), cwd=bag.parent)
    assert done.returncode == 0, done.stderr
    grid_map = load_from_bag(bag.parent / "survey")
    assert grid_map["elevation"].tolist() == [[1, 4], [2, 5], [0, 3]]
    assert (grid_map.frame_id, grid_map.timestamp) == ("odom", 5_000_000_007)
    assert (grid_map.position.tolist(), grid_map.resolution) == ([1.0, 2.0], 0.5)


def test_bag_of_ros_1_is_refused_with_the_conversion_command(bag):
    with pytest.raises(BagError, match="a bag of ROS 1; 'rosbags-convert' converts it"):
        load_from_bag(bag)


def test_polygon_methods_are_listed_beside_cpp():
    rows = [*table(page("docs/migration_cpp.md").section("Polygons"))]
    named = {name for row in rows for name in re.findall(r"[Pp]olygon\.(\w+)", row[1])}
    assert named == {name for name in dir(Polygon) if not name.startswith("_")}


def exists(name: str) -> bool:
    """Return whether a dotted name can be imported."""
    try:
        pkgutil.resolve_name(name)
    except (AttributeError, ImportError):
        return False
    return True


@pytest.mark.parametrize(
    ("path", "section"),
    [("from_0.1_to_0.2", "Names"), ("from_0.1_to_0.2", "Modules"), ("changed_names", "Names")],
)
def test_new_names_exist_and_old_names_are_gone(path, section):
    rows = [*table(page(f"docs/{path}.md").section(section))]
    assert len(rows) > 10
    for old, new in rows:
        gone, there = (re.findall(r"`(grid_map_[\w.]+)`", cell) for cell in (old, new))
        assert [name for name in gone if exists(name)] == []
        assert [name for name in there if not exists(name)] == []
