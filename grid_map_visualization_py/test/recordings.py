# SPDX-License-Identifier: BSD-3-Clause
"""A bag with messages of all types that Rerun shows, and what a recording of Rerun holds."""

import array
from collections import defaultdict
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, PoseStamped, TransformStamped, Vector3
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry, Path as PathMessage
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from grid_map_core_py import GridMap
from grid_map_ros_py import BagWriter, to_stamp
from grid_map_ros_py.bags._storage import Topic
from grid_map_ros_py.messages import serialize
from grid_map_ros_py.messages._point_cloud import write_points

BEGIN = 1_700_000_000_123_456_789
"""Time of the first map [ns]."""

STEP = 500_000_000
"""Time between maps [ns]."""

DELAY = 20_000_001
"""Time after which a map is recorded [ns]."""


def hills(number: int) -> GridMap:
    """Return one of the maps of the survey, which has moved in the circular buffer."""
    options = {"frame_id": "map", "timestamp": BEGIN + number * STEP}
    grid_map = GridMap((4.0, 3.0), 0.1, layers={"elevation": 0.0}, **options)
    grid_map.move((0.25 * number, 0.0))
    x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
    grid_map["elevation"] = 0.5 * np.sin(x) * np.cos(y)
    grid_map["elevation"][5:12, 5:9] = np.nan
    grid_map["slope"] = np.abs(0.5 * np.cos(x))
    return grid_map


def header(time: int, frame: str) -> Header:
    return Header(stamp=to_stamp(time), frame_id=frame)


def pose(x: float, y: float, z: float) -> Pose:
    return Pose(position=Point(x=x, y=y, z=z))


def transform(time: int, parent: str, child: str, *position: float) -> SimpleNamespace:
    """Return a `tf2_msgs/TFMessage`, whose package may be missing."""
    one = TransformStamped(header=header(time, parent), child_frame_id=child)
    place = one.transform.translation
    place.x, place.y, place.z = position
    return SimpleNamespace(transforms=[one])


def cloud(time: int, points: np.ndarray) -> PointCloud2:
    data = array.array("B", points.astype(np.float32).tobytes())
    return write_points("xyz", data, header(time, "lidar"))


def occupancy_grid(time: int) -> OccupancyGrid:
    info = MapMetaData(resolution=0.1, width=3, height=2, origin=pose(1.0, 2.0, 0.0))
    cells = [100, 0, -1, 50, 0, 0]
    return OccupancyGrid(header=header(time, "map"), info=info, data=cells)


def marker(time: int, kind: int, number: int, action: int = 0) -> Marker:
    found = Marker(header=header(time, "map"), ns="shapes", id=number, type=kind, action=action)
    found.pose = pose(float(number), -2.0, 0.0)
    found.scale = Vector3(x=0.3, y=0.3, z=0.3)
    found.color = ColorRGBA(r=1.0, g=0.5, a=1.0)
    found.text = "here"
    if kind in (4, 5, 6, 7, 8, 11):
        found.points = [Point(), Point(x=1.0), Point(y=1.0)]
    return found


MARKERS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11)
"""Types of the markers in the survey."""

POINTS = np.array([(0.0, 0.0, 0.0), (np.nan, 0.0, 0.0), (1.0, 2.0, 3.0)])


def put_into(bag: BagWriter, topic: str, kind: str, time: int, message: object) -> None:
    """Write a message into a bag."""
    topic_kind = Topic(kind.replace("/", "/msg/"), "cdr")
    bag.write_serialized(topic, topic_kind, time, serialize(message, message_type=kind))


def write_survey(path: Path, count: int = 3) -> None:
    """Write a bag with maps and the other messages of a robot that drives."""
    with BagWriter(path) as bag:
        put = partial(put_into, bag)
        still = transform(BEGIN, "base", "lidar", 0.0, 0.0, 0.5)
        put("/tf_static", "tf2_msgs/TFMessage", BEGIN, still)
        poses = []
        for number in range(count):
            time = BEGIN + number * STEP
            place = (0.25 * number, 0.0, 1.0)
            put("/tf", "tf2_msgs/TFMessage", time, transform(time, "map", "base", *place))
            bag.write("/grid_map", hills(number), time=time + DELAY)
            odometry = Odometry(header=header(time, "map"), child_frame_id="base")
            odometry.pose.pose = pose(*place)
            put("/odom", "nav_msgs/Odometry", time, odometry)
            poses.append(PoseStamped(header=header(time, "map"), pose=pose(*place)))
            put("/goal", "geometry_msgs/PoseStamped", time, poses[-1])
            way = PathMessage(header=header(time, "map"), poses=poses)
            put("/path", "nav_msgs/Path", time, way)
            put("/points", "sensor_msgs/PointCloud2", time, cloud(time, POINTS))
            put("/costmap", "nav_msgs/OccupancyGrid", time, occupancy_grid(time))
            shapes = [marker(time, kind, kind) for kind in MARKERS]
            shapes += [marker(time, 1, 99, action=Marker.DELETE)]
            put("/shapes", "visualization_msgs/MarkerArray", time, MarkerArray(markers=shapes))
            values = {"ms slope": str(2.5 + number), "ms blur": "none yet", "maps": "3"}
            pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
            status = DiagnosticStatus(name="chain", values=pairs)
            report = DiagnosticArray(header=header(time, ""), status=[status])
            put("/diagnostics", "diagnostic_msgs/DiagnosticArray", time, report)
            put("/chat", "geometry_msgs/Vector3", time, Vector3())


class Row(dict):
    """Components of a row as flat arrays by name, and its times [ns]."""

    def __init__(self, times: dict[str, int]) -> None:
        super().__init__()
        self.times = times


def rows_of(path: Path) -> dict[str, list[Row]]:
    """Return the rows of a recording by entity path, in the order of `ros_time`."""
    from rerun.chunk import RrdReader

    found = defaultdict(list)
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for number in range(batch.num_rows):
            row = Row({})
            for name in batch.schema.names:
                cell = batch.column(name)[number]
                if name in ("log_time", "ros_time"):
                    row.times[name] = cell.value
                elif ":" in name and cell.is_valid:
                    row[name] = flat(cell.values)
            found[chunk.entity_path].append(row)
    for rows in found.values():
        rows.sort(key=lambda row: row.times.get("ros_time", 0))
    return found


def flat(values: object) -> np.ndarray:
    while hasattr(values, "flatten") and "list" in str(values.type).split("<")[0]:
        values = values.flatten()
    return np.array(values.to_pylist() if "struct" in str(values.type) else values)
