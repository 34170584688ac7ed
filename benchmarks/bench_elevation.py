# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of elevation mapping: whole updates of a moving map, with visibility cleanup.

    python3 benchmarks/bench_elevation.py [--scan FILE] [--updates 300] [--topics]

Prints the median and 95th percentile of the time of an update and of each stage. Simulated lidars
drive in a circle in a walled yard with boxes. FILE contains a real scan: an .npz file with `points`
(N, 3) in the frame of a level lidar, with missing returns at the origin. The default is the file in
the environment variable GRID_MAP_LIDAR_SCAN; without a file, the real scan is skipped. With
`--topics`, the script prints the latency from publishing a scan to the callback with the map,
through the `elevation_mapping` node in another process, at 10 Hz. In `make bench`, each scan is a
row in yardsticks.
"""

import argparse
import array
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.elevation import ElevationMapper, LaserModel, UpdateReport
from grid_map_core_py.simulation import SpinningLidar, scan, with_box

RESOLUTION = 0.1
SCAN_PERIOD = 100_000_000  # nanoseconds
PLACES = 20
"""Number of different scans, along a circle driven at 0.5 m/s."""

VARIABLE = "GRID_MAP_LIDAR_SCAN"
COVARIANCE = np.diag([1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6])


@dataclass
class Drive:
    """Repeating scans of a driving robot, and the mapper that fuses them.

    Attributes:
        cells: side of the map [cells].
        scans: points (N, 3) in the sensor frame, and the transform (4, 4) to the map frame.
        reports: reports of all updates.
    """

    cells: int
    scans: list[tuple[np.ndarray, np.ndarray]]
    reports: list[UpdateReport] = field(default_factory=list)

    def __post_init__(self) -> None:
        side = self.cells * RESOLUTION
        geometry = GridGeometry((side, side), RESOLUTION)
        self.mapper = ElevationMapper(geometry, sensor=LaserModel(), min_range=0.5)
        self._next, self._time = cycle(self.scans), 0

    def update(self) -> None:
        points, transform = next(self._next)
        self._time += SCAN_PERIOD
        report = self.mapper.update(
            points,
            transform,
            timestamp=self._time,
            pose_covariance=COVARIANCE,
            position=transform[:2, 3],
        )
        self.reports.append(report)


@cache
def yard() -> GridMap:
    """Return a rough 40 m x 40 m ground with boxes, inside a wall that stops all beams."""
    grid_map = GridMap((40.0, 40.0), RESOLUTION, layers={"elevation": 8.0})
    x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
    rough = 0.05 * np.sin(1.3 * x) * np.cos(0.9 * y) + 0.01 * np.sin(7.0 * x + 3.0 * y)
    inside = np.maximum(abs(x), abs(y)) < 19.0
    grid_map["elevation"][inside] = rough[inside]
    random = np.random.default_rng(2)
    for angle in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        center = random.uniform(2.0, 12.0) * np.array([np.cos(angle), np.sin(angle)])
        sides = random.uniform(0.3, 1.0, 2)
        grid_map = with_box(grid_map, center, sides, random.uniform(0.1, 1.5), yaw=angle)
    return grid_map


def simulated(cells: int, lidar: SpinningLidar) -> Drive:
    """Return the drive of a robot whose lidar is 0.8 m above the ground."""
    scans, random = [], np.random.default_rng(3)
    step = 0.5 * 1e-9 * SCAN_PERIOD
    for angle in np.linspace(0.0, 2.0 * np.pi, PLACES, endpoint=False):
        transform = np.eye(4)
        transform[:2, 3] = PLACES * step / (2.0 * np.pi) * np.array([np.cos(angle), np.sin(angle)])
        transform[2, 3] = 0.8
        points = scan(yard(), lidar.directions, transform, sensor=LaserModel(), random=random)
        scans.append((points.astype(np.float32), transform))
    return Drive(cells, scans)


def real(path: Path) -> Drive:
    """Return the drive of a standing robot: a real scan, repeated with little noise."""
    with np.load(path) as file:
        points = file["points"].astype(np.float32)
    missing = ~points.any(axis=1)
    random, scans = np.random.default_rng(4), []
    for _ in range(10):
        noisy = points + random.normal(0.0, 0.005, points.shape).astype(np.float32)
        noisy[missing] = 0.0
        transform = np.eye(4)
        transform[2, 3] = 1.7
        scans.append((noisy, transform))
    return Drive(400, scans)


DRIVES: dict[str, Callable[[], Drive]] = {
    "30,000 points, 16 rings": lambda: simulated(150, SpinningLidar(azimuths=1875)),
    "100,000 points, 64 rings": lambda: simulated(200, SpinningLidar(rings=64, azimuths=1563)),
}


@pytest.mark.parametrize("name", DRIVES)
def test_update(measure, name):
    drive = DRIVES[name]()
    measure(f"ElevationMapper.update {name}", drive.cells, drive.update)
    elevation = drive.mapper.grid_map["elevation"]
    points, transform = drive.scans[-1]
    x_y = points[np.isfinite(points[:, 0]), :2] + transform[:2, 3]
    seen = drive.mapper.grid_map.get_indices(x_y[drive.mapper.grid_map.is_inside(x_y)])[0]
    assert np.isfinite(elevation[seen]).mean() > 0.9
    truth = yard().at_position("elevation", drive.mapper.grid_map.get_positions())
    errors = abs(elevation.ravel("F") - truth)
    assert np.nanmedian(errors) < 0.02


def test_update_by_a_real_scan(measure):
    path = real_scan()
    if path is None:
        pytest.skip(f"there is no real scan: {VARIABLE} names no file")
    drive = real(path)
    measure("ElevationMapper.update real scan", drive.cells, drive.update)
    elevation = drive.mapper.grid_map["elevation"]
    assert np.isfinite(elevation).sum() > 5000
    # The lowest cells are ground around the sensor, which is 1.7 m above the ground.
    assert abs(np.nanpercentile(elevation, 10)) < 0.7


def real_scan(given: Path | None = None) -> Path | None:
    """Return the file of the real scan, or None if no existing file is given."""
    path = given or Path(os.environ.get(VARIABLE, ""))
    return path if path.is_file() else None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scan", type=Path, metavar="FILE", help="a real scan")
    parser.add_argument("--updates", type=int, default=300, help="number of updates per row")
    parser.add_argument("--topics", action="store_true", help="measure from topic to topic")
    options = parser.parse_args()
    drives: dict[str, Callable[[], Drive]] = dict(DRIVES)
    if path := real_scan(options.scan):
        drives["a real scan"] = lambda: real(path)
    else:
        print(f"The real scan is missing: neither --scan nor {VARIABLE} names a file.\n")
    for name, made in drives.items():
        timing = timed_on_topics if options.topics else timed
        print("\n".join(timing(name, made(), options.updates)), flush=True)


def timed(name: str, drive: Drive, updates: int) -> Iterator[str]:
    """Yield the output lines of a drive; the first ten updates compile and fill the map."""
    for _ in range(10):
        drive.update()
    drive.reports.clear()
    times = []
    for _ in range(updates):
        begin = time.perf_counter()
        drive.update()
        times.append(1e3 * (time.perf_counter() - begin))
    points = int(np.median([r.points_used + r.points_gated for r in drive.reports]))
    middle, most = np.percentile(times, [50, 95])
    yield f"{name}; {drive.cells} x {drive.cells} cells, {points} points on them"
    yield f"  update  p50 {middle:6.2f} ms   p95 {most:6.2f} ms"
    stages: list[Any] = [report.milliseconds for report in drive.reports]
    for stage in stages[0]:
        middle, most = np.percentile([times[stage] for times in stages], [50, 95])
        yield f"  {stage:24}{middle:8.2f} {most:8.2f}"


def timed_on_topics(name: str, drive: Drive, updates: int) -> Iterator[str]:
    """Yield the output lines of a drive through the node; the first ten scans are excluded."""
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import PointCloud2
    from std_msgs.msg import Header

    from grid_map_msgs.msg import GridMap as GridMapMessage
    from grid_map_ros_py import from_serialized_message, to_pose, to_stamp
    from grid_map_ros_py.messages import (
        serialize,
    )
    from grid_map_ros_py.messages._point_cloud import write_points
    from grid_map_ros_py.nodes import map_qos
    from grid_map_ros_py.testing import peer, running_node

    side = drive.cells * RESOLUTION
    given: dict[str, Any] = {
        "map_frame_id": "odom",
        "pose_source": "topic",
        "robot_pose_with_covariance_topic": "/pose",
        **dict.fromkeys(["length_in_x", "length_in_y"], side),
        "resolution": RESOLUTION,
        "fused_map_publishing_rate": 0.0,
        "input_sources.lidar.topic": "/scan",
        "input_sources.lidar.min_range": 0.5,
    }
    words = [word for pair in given.items() for word in ("-p", "{}:={}".format(*pair))]
    arrived: dict[int, int] = {}

    def note(data: bytes) -> None:
        now = time.time_ns()
        arrived.setdefault(from_serialized_message(data, ["elevation"]).timestamp, now)

    latencies = []
    module = "grid_map_ros_py._executables.elevation_mapping"
    with peer() as other, running_node(module, "--ros-args", *words):
        topic = "/elevation_mapping/elevation_map_raw"
        other.node.create_subscription(GridMapMessage, topic, note, map_qos(), raw=True)
        qos = QoSProfile(depth=1)
        poses = other.node.create_publisher(PoseWithCovarianceStamped, "/pose", qos)
        clouds = other.node.create_publisher(PointCloud2, "/scan", qos)
        topics = (poses, clouds)
        other.wait_until(lambda: all(each.get_subscription_count() for each in topics), "the node")
        for (points, transform), _ in zip(cycle(drive.scans), range(updates + 10), strict=False):
            pose = PoseWithCovarianceStamped()
            pose.pose.pose, pose.pose.covariance = to_pose(transform), COVARIANCE.ravel()
            data = array.array("B", points.astype("<f4").tobytes())
            stamp = time.time_ns()
            pose.header = Header(stamp=to_stamp(stamp), frame_id="odom")
            header = Header(stamp=to_stamp(stamp), frame_id="base_link")
            cloud = serialize(write_points("xyz", data, header))
            begin = time.time_ns()
            poses.publish(pose)
            clouds.publish(cloud)
            other.wait_until(lambda stamp=stamp: stamp in arrived, "the map of a scan")
            latencies.append(1e-6 * (arrived[stamp] - begin))
            other.spin(max(0.0, 1e-9 * (begin + SCAN_PERIOD - time.time_ns())))
    middle, most = np.percentile(latencies[10:], [50, 95])
    yield f"{name}; {drive.cells} x {drive.cells} cells, from topic to topic"
    yield f"  p50 {middle:6.2f} ms   p95 {most:6.2f} ms"


if __name__ == "__main__":
    main()
