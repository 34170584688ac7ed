# SPDX-License-Identifier: BSD-3-Clause
"""A bag with messages of all types that Rerun shows, and what a recording of Rerun holds."""

from collections import defaultdict
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from grid_map_core_py import GridMap
from grid_map_ros_py import BagWriter
from grid_map_ros_py.bags._storage import Topic
from grid_map_ros_py.messages import serialize

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


def header(time: int, frame: str) -> SimpleNamespace:
    return SimpleNamespace(stamp=stamp(time), frame_id=frame)


def stamp(time: int) -> SimpleNamespace:
    return SimpleNamespace(sec=time // 10**9, nanosec=time % 10**9)


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> SimpleNamespace:
    return SimpleNamespace(x=x, y=y, z=z)


def pose(x: float, y: float, z: float) -> SimpleNamespace:
    turn = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    return SimpleNamespace(position=vector(x, y, z), orientation=turn)


def transform(time: int, parent: str, child: str, *position: float) -> SimpleNamespace:
    place = pose(*position)
    moved = SimpleNamespace(translation=place.position, rotation=place.orientation)
    one = SimpleNamespace(header=header(time, parent), child_frame_id=child, transform=moved)
    return SimpleNamespace(transforms=[one])


def cloud(time: int, points: np.ndarray) -> SimpleNamespace:
    fields = [
        SimpleNamespace(name=name, offset=4 * axis, datatype=7, count=1)
        for axis, name in enumerate("xyz")
    ]
    size = {"height": 1, "width": len(points), "point_step": 12, "row_step": 12 * len(points)}
    data = np.frombuffer(points.astype(np.float32).tobytes(), np.uint8)
    flags = {"is_bigendian": False, "is_dense": False}
    return SimpleNamespace(header=header(time, "lidar"), fields=fields, data=data, **size, **flags)


def occupancy_grid(time: int) -> SimpleNamespace:
    size = {"resolution": 0.1, "width": 3, "height": 2}
    info = SimpleNamespace(map_load_time=stamp(0), **size, origin=pose(1, 2, 0))
    cells = np.array([100, 0, -1, 50, 0, 0], np.int8)
    return SimpleNamespace(header=header(time, "map"), info=info, data=cells)


def marker(time: int, kind: int, number: int, action: int = 0) -> SimpleNamespace:
    corners = [vector(), vector(1.0), vector(0.0, 1.0)] if kind in (4, 5, 6, 7, 8, 11) else []
    texture = SimpleNamespace(header=header(0, ""), format="", data=[])
    return SimpleNamespace(
        header=header(time, "map"),
        ns="shapes",
        id=number,
        type=kind,
        action=action,
        pose=pose(float(number), -2.0, 0.0),
        scale=vector(0.3, 0.3, 0.3),
        color=SimpleNamespace(r=1.0, g=0.5, b=0.0, a=1.0),
        lifetime=stamp(0),
        frame_locked=False,
        points=corners,
        colors=[],
        texture_resource="",
        texture=texture,
        uv_coordinates=[],
        text="here",
        mesh_resource="",
        mesh_file=SimpleNamespace(filename="", data=[]),
        mesh_use_embedded_materials=False,
    )


MARKERS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11)
"""Types of the markers in the survey."""

POINTS = np.array([(0.0, 0.0, 0.0), (np.nan, 0.0, 0.0), (1.0, 2.0, 3.0)])


def put_into(bag: BagWriter, topic: str, kind: str, time: int, message: SimpleNamespace) -> None:
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
            zeros = np.zeros(36)
            odometry = SimpleNamespace(
                header=header(time, "map"),
                child_frame_id="base",
                pose=SimpleNamespace(pose=pose(*place), covariance=zeros),
                twist=SimpleNamespace(
                    twist=SimpleNamespace(linear=vector(), angular=vector()), covariance=zeros
                ),
            )
            put("/odom", "nav_msgs/Odometry", time, odometry)
            poses.append(SimpleNamespace(header=header(time, "map"), pose=pose(*place)))
            put("/goal", "geometry_msgs/PoseStamped", time, poses[-1])
            path_message = SimpleNamespace(header=header(time, "map"), poses=poses)
            put("/path", "nav_msgs/Path", time, path_message)
            put("/points", "sensor_msgs/PointCloud2", time, cloud(time, POINTS))
            put("/costmap", "nav_msgs/OccupancyGrid", time, occupancy_grid(time))
            shapes = [marker(time, kind, kind) for kind in MARKERS]
            shapes += [marker(time, 1, 99, action=2)]
            array = SimpleNamespace(markers=shapes)
            put("/shapes", "visualization_msgs/MarkerArray", time, array)
            values = [
                SimpleNamespace(key="ms slope", value=str(2.5 + number)),
                SimpleNamespace(key="ms blur", value="none yet"),
                SimpleNamespace(key="maps", value="3"),
            ]
            status = SimpleNamespace(
                level=b"\0", name="chain", message="", hardware_id="", values=values
            )
            report = SimpleNamespace(header=header(time, ""), status=[status])
            put("/diagnostics", "diagnostic_msgs/DiagnosticArray", time, report)
            put("/chat", "geometry_msgs/Vector3", time, vector())


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
