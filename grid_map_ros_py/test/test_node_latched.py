# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Latched maps between processes, received by plain rclpy."""

import json
from typing import Any

from conftest import Start
from grid_map_ros_py.testing import Process, wait_until

# The map moved by two cells along x; the buffer's last rows hold new cells without data.
EXPECTED = {
    "frame_id": "odom",
    "stamp": [5, 6],
    "position": [4.0, 4.0],
    "layers": ["elevation"],
    "dims": [["column_index", 3, 12], ["row_index", 4, 4]],
    "start_index": [2, 0],
    "data": [
        *("0.0", "3.0", "nan", "nan"),
        *("1.0", "4.0", "nan", "nan"),
        *("2.0", "5.0", "nan", "nan"),
    ],
}


def map_received_by(subscriber: Process) -> Any:
    assert subscriber.wait() == 0, subscriber.text
    return json.loads(subscriber.lines[-1])


def wait_for(process: Process, line: str) -> None:
    wait_until(lambda: f"{line}\n" in process.lines, line)


def test_plain_subscriber_receives_the_map(start: Start) -> None:
    subscriber = start("plain_subscriber.py", "TRANSIENT_LOCAL")
    wait_for(subscriber, "subscribed")
    start("publisher.py")
    assert map_received_by(subscriber) == EXPECTED


def test_late_subscriber_receives_the_last_map(start: Start) -> None:
    wait_for(start("publisher.py"), "published")
    assert map_received_by(start("plain_subscriber.py", "TRANSIENT_LOCAL")) == EXPECTED
