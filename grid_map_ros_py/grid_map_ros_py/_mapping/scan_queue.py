# SPDX-License-Identifier: BSD-3-Clause
"""Scans of a sensor, each of which is fused as soon as its pose is known."""

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy.typing as npt

from grid_map_core_py.elevation import RollingMap
from grid_map_core_py.plugins import check

from ..errors import DROPPED, reason
from ..messages._cdr import view
from ..messages._packages import messages_of
from ..messages._point_cloud import read_columns
from ..messages._time import NANOSECONDS, from_stamp
from .poses import LONGEST_JITTER, Placement, Poses


@dataclass
class Statistics:
    """Numbers of fused and dropped scans; points of the fused ones, and time spent on them [s]."""

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


@dataclass(frozen=True)
class Scan:
    """Points of a sensor at a time.

    Attributes:
        frame_id: frame of the points.
        stamp: time of the scan [ns].
        points: (N, 3) x, y, z [m].
        columns: (N,) values of further layers.
    """

    frame_id: str
    stamp: int
    points: npt.NDArray[Any]
    columns: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.points)


@dataclass
class ScanQueue:
    """Scans of one sensor that wait for their poses.

    A scan that is more than `LONGEST_JITTER` earlier than the one before means that time was reset,
    as by a bag that is played again: poses and scans of later times are forgotten.

    Attributes:
        poses: source of the poses.
        read: returns the scan in a message, or another object with `frame_id`, `stamp` and a
            length; raises `GridMapError` if the message is invalid.
        fuse: called with a scan and its placement; raises `GridMapError` if the scan is invalid.
        report: called with the reason when a scan is dropped.
        what: name of the messages, for the reasons.
        timeout: maximum time a scan waits for its pose [s].
        queue_size: maximum number of waiting scans; a further one replaces the oldest.
        clock: returns the time [s]; the default runs on while a simulation is paused.
        statistics: counts of scans.
    """

    poses: Poses
    read: Callable[[Any], Any]
    fuse: Callable[[Any, Placement], object]
    report: Callable[[str], object]
    what: str = "a cloud"
    timeout: float = 1.0
    queue_size: int = 10
    clock: Callable[[], float] = time.monotonic
    statistics: Statistics = field(default_factory=Statistics)
    _waiting: deque[tuple[Any, float]] = field(default_factory=deque, init=False)
    _latest: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        check(self.timeout >= 0, "pose_timeout", "no negative number", self.timeout)
        check(self.queue_size > 0, "queue_size", "at least 1", self.queue_size)

    def add(self, message: Any) -> bool:
        """Add a message, and return whether a scan was fused."""
        try:
            scan = self.read(message)
        except DROPPED as error:
            self._drop(reason(error))
            return False
        self._watch_time(scan.stamp)
        if len(self._waiting) == self.queue_size:
            self._waiting.popleft()
            self._drop(f"{self.queue_size} newer ones wait for {self.poses.waits_for}")
        self._waiting.append((scan, self.clock()))
        return self.work()

    def work(self) -> bool:
        """Fuse the scans whose poses are known; return whether there was one.

        Call it when a pose arrives, and periodically to drop scans that have waited too long.
        """
        fused = self.statistics.fused
        # A waiting scan does not delay scans of other frames.
        self._waiting = deque(entry for entry in self._waiting if not self._finish(*entry))
        return self.statistics.fused > fused

    def _watch_time(self, stamp: int) -> None:
        if stamp and stamp < self._latest - LONGEST_JITTER:
            text = (
                f"its time is {(self._latest - stamp) / NANOSECONDS:.1f} s after that of the next"
            )
            for _ in self._waiting:
                self._drop(text)
            self._waiting.clear()
            self.poses.go_back(stamp)
            self._latest = stamp
        self._latest = max(self._latest, stamp)

    def _finish(self, scan: Any, received: float) -> bool:
        """Fuse or drop a scan; return False if it has to wait longer."""
        begin = time.perf_counter()
        try:
            placement = self.poses.place(scan.frame_id, scan.stamp)
            if placement is not None:
                self.fuse(scan, placement)
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


def read_cloud(message: Any, fields: Iterable[str] = ()) -> Scan:
    """Return the scan in a `PointCloud2` or its bytes, with some of its fields as columns.

    Raises:
        MessageError: the message contradicts itself, or lacks a field.
    """
    if isinstance(message, bytes):
        message = view(message, messages_of("sensor_msgs").PointCloud2)
    stamp = from_stamp(message.header.stamp)
    return Scan(message.header.frame_id, stamp, *read_columns(message, fields))


@dataclass
class RollingFusion:
    """Fuses scans into a `RollingMap`.

    Attributes:
        rolling_map: the map.
        follow: True if the map moves with the robot.
        min_range, max_range: distances from the origin of the scan's frame [m]; points nearer or
            farther are left out.
    """

    rolling_map: RollingMap
    follow: bool = True
    min_range: float = 0.0
    max_range: float = math.inf

    def __post_init__(self) -> None:
        ranges = 0 <= self.min_range < self.max_range
        check(ranges, "min_range", "at least 0 and below max_range", self.min_range)

    def __call__(self, scan: Scan, placement: Placement) -> None:
        """Fuse a scan; after an error the map is unchanged."""
        self.rolling_map.fuse(
            scan.points,
            scan.columns,
            transform=placement.transform,
            min_range=self.min_range,
            max_range=self.max_range,
            position=placement.center if self.follow else None,
            timestamp=scan.stamp,
        )
