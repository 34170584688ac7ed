# SPDX-License-Identifier: BSD-3-Clause
"""Queues of sensor scans, which are fused as soon as their poses are known."""

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

from grid_map_core_py.elevation._points import distances_of
from grid_map_core_py.plugins import check

from ..errors import DROPPED, reason
from ..messages._cdr import view
from ..messages._fields import NANOSECONDS, from_stamp
from ..messages._point_cloud import read_columns
from ._health import LogThrottle, health_of
from ._poses import LONGEST_JITTER, Placement, Poses, check_optical_frame
from ._spin import steady_timer
from ._topics import describe_topic, warn_of_gaps

WAIT_PERIOD = 0.05
"""Time between two attempts to find the poses of waiting scans [s]."""

SILENCE = 3.0
"""Time without messages after which a sensor is reported as silent [s]."""


@dataclass
class Statistics:
    """Counts of scans; `points` and `seconds` are totals over all fused scans."""

    fused: int = 0
    dropped: int = 0
    points: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        mean = 1e3 * self.seconds / max(self.fused, 1)
        return (
            f"{self.fused} clouds with {self.points} points fused, {mean:.1f} ms per cloud; "
            f"{self.dropped} clouds dropped"
        )


FEW = 0.01
"""A node warns if it uses less than this fraction of the points in a scan."""

FARTHEST = 200.0
"""Median range [m] above which points are probably in millimeters."""

REMEDIES = {
    "outside the map": "Check the pose of the sensor and the size of the map",
    "in cells more uncertain than max_variance": "Check sensor_processor and the pose covariance",
    "not measured by the sensor": "Check sensor_processor; cameras need a frame with z forward",
    "in contradiction to the map": "Check the pose of the sensor",
    "without a depth": "Check the camera",
}
"""Remedies by the main reason why points are unused; other reasons name the parameter to check."""


@dataclass(frozen=True)
class Cloud:
    """Point cloud of one scan: `points` (N, 3) [m] and `columns` (N,) by layer name.

    `missing` is the number of pixels without a depth. `is_optical` is true if z points forward.
    """

    frame_id: str
    stamp: int
    points: npt.NDArray[Any]
    columns: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    missing: int = 0
    is_optical: bool = False

    def __len__(self) -> int:
        return len(self.points)

    def usage(self, unused: Mapping[str, int]) -> str:
        """Return a warning if less than the fraction `FEW` of the points is used, or "".

        `unused` contains the number of unused points for each reason.
        """
        total = len(self) + self.missing
        counts = Counter({**unused, "without a depth": self.missing}).most_common()
        used = total - sum(count for _, count in counts)
        if used >= max(FEW * total, 1):
            return ""
        causes = ", ".join(f"{count} are {reason}" for reason, count in counts if count)
        ranges = distances_of(self.points[:, :3].T.astype(np.float64))
        ranges = ranges[np.isfinite(ranges)]
        remedy = REMEDIES.get(counts[0][0], "")
        if len(ranges) and np.median(ranges) > FARTHEST:
            remedy = f"The median range is {np.median(ranges):.0f} m: convert millimeters to meters"
        elif not total:
            causes, remedy = "the message is empty", "Check the sensor"
        return f"few points: used {used} of {total} points because {causes}. {remedy}".rstrip(". ")


@dataclass
class ScanQueue:
    """Queue of the scans of one sensor that wait for their poses.

    After a time reset (see `LONGEST_JITTER`), waiting scans and outdated poses are discarded.

    Attributes:
        read: converts a message to a scan, and raises `GridMapError` if the message is invalid. A
            scan is a `Cloud`, or another object with `frame_id`, `stamp` and a length.
        fuse: called with a scan and its placement. It returns the number of unused points by
            reason, or None, and raises `GridMapError` if the scan is invalid.
        what: name of a scan in error messages, such as "a cloud".
        timeout: maximum time a scan waits for its pose [s].
        queue_size: maximum number of waiting scans; an additional scan replaces the oldest.
        problem: warning from `Cloud.usage` about the last fused scan, or "".
    """

    poses: Poses
    read: Callable[[Any], Any]
    fuse: Callable[[Any, Placement], Mapping[str, int] | None]
    report: Callable[[str], object] = lambda _text: None
    what: str = "a cloud"
    timeout: float = 1.0
    queue_size: int = 10
    clock: Callable[[], float] = time.monotonic
    statistics: Statistics = field(default_factory=Statistics)
    problem: str = field(default="", init=False)
    _waiting: deque[tuple[Any, float]] = field(default_factory=deque, init=False)
    _latest: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        check(self.timeout >= 0, "pose_timeout", "no negative number", self.timeout)
        check(self.queue_size > 0, "queue_size", "at least 1", self.queue_size)

    def add(self, message: Any) -> int:
        """Queue the scan of a message; return the number of scans fused in this call."""
        try:
            scan = self.read(message)
        except DROPPED as error:
            self._drop(reason(error))
            return 0
        if scan.stamp and scan.stamp < self._latest - LONGEST_JITTER:
            seconds = (self._latest - scan.stamp) / NANOSECONDS
            for _ in self._waiting:
                self._drop(f"its time is {seconds:.1f} s after that of the next")
            self._waiting.clear()
            self.poses.go_back(scan.stamp)
            self._latest = scan.stamp
        self._latest = max(self._latest, scan.stamp)
        if len(self._waiting) == self.queue_size:
            self._waiting.popleft()
            self._drop(f"{self.queue_size} newer ones wait for {self.poses.waits_for}")
        self._waiting.append((scan, self.clock()))
        return self.work()

    def work(self) -> int:
        """Fuse scans with known poses, drop expired scans, and return how many were fused."""
        fused = self.statistics.fused
        # A waiting scan does not delay scans of other frames.
        self._waiting = deque(entry for entry in self._waiting if not self._finish(*entry))
        return self.statistics.fused - fused

    def _finish(self, scan: Any, received: float) -> bool:
        """Fuse or drop a scan; return False if the scan must keep waiting."""
        begin = time.perf_counter()
        try:
            placement = self.poses.place(scan.frame_id, scan.stamp)
            if placement is not None:
                if scan.is_optical or scan.frame_id.endswith("_optical_frame"):
                    check_optical_frame(scan.frame_id, placement)
                unused = self.fuse(scan, placement)
                self.problem = "" if unused is None else scan.usage(unused)
                self.statistics.fused += 1
                self.statistics.points += len(scan)
                self.statistics.seconds += time.perf_counter() - begin
            elif self.clock() - received < self.timeout:
                return False
            else:
                self._drop(f"it waited {self.timeout} s for {self.poses.waits_for}")
        except DROPPED as error:
            self._drop(reason(error))
        return True

    def _drop(self, why: str) -> None:
        self.statistics.dropped += 1
        self.report(f"dropped {self.what}: {why}")


def read_cloud(message: Any, fields: Iterable[str] = ()) -> Cloud:
    """Decode a `PointCloud2`, or its serialized bytes, with `fields` as columns."""
    if isinstance(message, bytes):
        message = view(message, PointCloud2)
    stamp = from_stamp(message.header.stamp)
    return Cloud(message.header.frame_id, stamp, *read_columns(message, fields))


class ScanInputs:
    """Subscribes to scan topics and passes the scans to their queues.

    `prepare` is called before queued scans are fused. While `is_enabled` is False, new scans are
    ignored.
    """

    def __init__(
        self, node: Node, log: LogThrottle, prepare: Callable[[], object] | None = None
    ) -> None:
        self._node, self._log, self._prepare = node, log, prepare
        self._health = health_of(node)
        self._sensors: list[_Sensor] = []
        self.is_enabled = True
        steady_timer(node, WAIT_PERIOD, self.work)

    def subscribe(
        self,
        message_type: type,
        topic: str,
        queue: ScanQueue,
        on_fused: Callable[[], object],
        *,
        name: str = "a sensor",
        is_reliable: bool = False,
    ) -> str:
        """Add the messages of a topic to a queue; return the full name of the topic.

        `on_fused` is called after each fusion. `name` identifies the sensor in the log.
        """
        queue.report = self._drop
        sensor = _Sensor(name, topic, message_type, queue, on_fused, time.monotonic())
        self._sensors.append(sensor)
        policy = ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT
        subscription = self._node.create_subscription(
            message_type,
            topic,
            partial(self._receive, sensor),
            QoSProfile(depth=queue.queue_size, reliability=policy),
            event_callbacks=SubscriptionEventCallbacks(
                message_lost=warn_of_gaps(self._node, topic)
            ),
            raw=True,
        )
        sensor.topic = str(subscription.topic_name)
        return sensor.topic

    def work(self) -> None:
        if self._prepare:
            self._prepare()
        now = time.monotonic()
        for sensor in self._sensors:
            self._count(sensor, sensor.queue.work())
            if now - sensor.heard > SILENCE:
                sensor.heard = math.inf
                topic = describe_topic(self._node, sensor.topic, sensor.message_type)
                self._note(sensor, f"no messages of {sensor.name} on {topic}")

    def _receive(self, sensor: "_Sensor", data: bytes) -> None:
        if sensor.heard == math.inf:
            self._note(sensor, "")
        sensor.heard = time.monotonic()
        if self.is_enabled:
            self._health.receive()
            self._count(sensor, sensor.queue.add(data))

    def _count(self, sensor: "_Sensor", fused: int) -> None:
        if fused:
            self._health.use(fused)
            problem = sensor.queue.problem
            self._note(sensor, f"{sensor.topic}: {problem}" if problem else "")
            sensor.on_fused()

    def _note(self, sensor: "_Sensor", problem: str) -> None:
        sensor.problem = problem
        self._health.problem = "; ".join(each.problem for each in self._sensors if each.problem)
        if problem:
            self._log.warning(problem)

    def _drop(self, text: str) -> None:
        self._health.drop(text)
        self._log.warning(text)


@dataclass
class _Sensor:
    """State of a sensor; `heard` is the time [s] of the last message, or infinity if silent."""

    name: str
    topic: str
    message_type: type
    queue: ScanQueue
    on_fused: Callable[[], object]
    heard: float
    problem: str = ""
