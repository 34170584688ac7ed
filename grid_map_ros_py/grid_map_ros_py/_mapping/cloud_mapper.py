# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Fusion of point clouds into a rolling map, each as soon as its pose is known."""

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
from ..messages._time import from_stamp
from .poses import Placement, Poses


@dataclass
class Statistics:
    """Numbers of fused and dropped clouds; points of the fused ones, and time spent on them [s]."""

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
class Cloud:
    """A cloud that waits for its pose.

    Attributes:
        frame_id: frame of the points.
        stamp: time of the cloud [ns].
        points: (N, 3) x, y, z [m].
        columns: (N,) values of further layers.
        received: time of arrival on the mapper's clock [s].
    """

    frame_id: str
    stamp: int
    points: npt.NDArray[Any]
    columns: Mapping[str, npt.NDArray[Any]]
    received: float


@dataclass
class CloudMapper:
    """Transforms clouds into the frame of a map and fuses them, once their poses are known.

    Attributes:
        rolling_map: the map.
        poses: source of the poses.
        report: called with the reason when a cloud is dropped.
        fields: names of the fields of clouds that become layers besides the heights.
        follow: True if the map moves with the robot.
        min_range, max_range: distances from the origin of the cloud's frame [m]; points nearer or
            farther are left out.
        timeout: maximum time a cloud waits for its pose [s].
        queue_size: maximum number of waiting clouds; a further one replaces the oldest.
        clock: returns the time [s]; the default runs on while a simulation is paused.
        statistics: counts of clouds.
    """

    rolling_map: RollingMap
    poses: Poses
    report: Callable[[str], object]
    fields: Iterable[str] = ()
    follow: bool = True
    min_range: float = 0.0
    max_range: float = math.inf
    timeout: float = 1.0
    queue_size: int = 10
    clock: Callable[[], float] = time.monotonic
    statistics: Statistics = field(default_factory=Statistics)
    _waiting: deque[Cloud] = field(default_factory=deque, init=False)

    def __post_init__(self) -> None:
        ranges = 0 <= self.min_range < self.max_range
        check(ranges, "min_range", "at least 0 and below max_range", self.min_range)
        check(self.timeout >= 0, "pose_timeout", "no negative number", self.timeout)
        check(self.queue_size > 0, "queue_size", "at least 1", self.queue_size)

    def add(self, message: Any) -> bool:
        """Add a `PointCloud2` or its bytes, and return whether the map has changed."""
        try:
            if isinstance(message, bytes):
                message = view(message, messages_of("sensor_msgs").PointCloud2)
            stamp = from_stamp(message.header.stamp)
            points, columns = read_columns(message, self.fields)
        except DROPPED as error:
            self._drop(reason(error))
            return False
        if len(self._waiting) == self.queue_size:
            self._waiting.popleft()
            self._drop(f"{self.queue_size} newer ones wait for {self.poses.waits_for}")
        self._waiting.append(Cloud(message.header.frame_id, stamp, points, columns, self.clock()))
        return self.work()

    def work(self) -> bool:
        """Fuse the clouds whose poses are known; return whether the map has changed.

        Call it when a pose arrives, and periodically to drop clouds that have waited too long.
        """
        fused = self.statistics.fused
        # A waiting cloud does not delay clouds of other frames.
        self._waiting = deque(cloud for cloud in self._waiting if not self._finish(cloud))
        return self.statistics.fused > fused

    def _finish(self, cloud: Cloud) -> bool:
        """Fuse or drop a cloud; return False if it has to wait longer."""
        begin = time.perf_counter()
        try:
            placement = self.poses.place(cloud.frame_id, cloud.stamp)
            if placement is not None:
                self._fuse(cloud, placement)
                self.statistics.fused += 1
                self.statistics.points += len(cloud.points)
                self.statistics.seconds += time.perf_counter() - begin
            elif self.clock() - cloud.received < self.timeout:
                return False
            else:
                self._drop(f"it waited {self.timeout} s for {self.poses.waits_for}")
        except DROPPED as error:
            self._drop(reason(error))
        return True

    def _fuse(self, cloud: Cloud, placement: Placement) -> None:
        self.rolling_map.fuse(
            cloud.points,
            cloud.columns,
            transform=placement.transform,
            min_range=self.min_range,
            max_range=self.max_range,
            position=placement.center if self.follow else None,
            timestamp=cloud.stamp,
        )

    def _drop(self, why: str) -> None:
        self.statistics.dropped += 1
        self.report(f"dropped a cloud: {why}")
