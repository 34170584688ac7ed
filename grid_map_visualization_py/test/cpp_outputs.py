# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Serialized messages that the C++ nodes published."""

import gzip
from pathlib import Path
from typing import Any

from rclpy.serialization import deserialize_message

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message

FOLDER = Path(__file__).parent / "data"


def recorded_bytes(name: str) -> bytes:
    """Return the message `<recording>/<topic>` in CDR."""
    return gzip.decompress((FOLDER / f"{name}.cdr.gz").read_bytes())


def recorded(name: str, message_type: type) -> Any:
    """Return the message `<recording>/<topic>`."""
    return deserialize_message(recorded_bytes(name), message_type)


def recorded_map(name: str) -> GridMap:
    """Return the map that was published on `<recording>/<topic>`."""
    return from_message(recorded(name, GridMapMessage), unwrap=False)
