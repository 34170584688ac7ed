# SPDX-License-Identifier: BSD-3-Clause
"""Exact conversion between integer nanoseconds and `builtin_interfaces/Time`."""

import operator
from typing import TYPE_CHECKING

from grid_map_core_py import GridMap

from ..errors import MessageError
from ._packages import messages_of

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time
    from std_msgs.msg import Header

NANOSECONDS = 1_000_000_000
LATEST = (2**31 - 1) * NANOSECONDS + NANOSECONDS - 1
"""The last nanosecond whose seconds fit the message's int32."""


def to_stamp(nanoseconds: int) -> "Time":
    """Return nanoseconds since the epoch as a message."""
    seconds, rest = divmod(check_nanoseconds(nanoseconds), NANOSECONDS)
    return messages_of("builtin_interfaces").Time(sec=seconds, nanosec=rest)


def check_nanoseconds(nanoseconds: int) -> int:
    """Return nanoseconds since the epoch as an integer that a message can hold."""
    try:
        exact = operator.index(nanoseconds)
    except TypeError:
        raise MessageError("stamp", "an integer number of nanoseconds", nanoseconds) from None
    if not 0 <= exact <= LATEST:
        raise MessageError("stamp", f"nanoseconds from 0 to {LATEST}", exact)
    return exact


def from_stamp(stamp: "Time", field: str = "header.stamp") -> int:
    """Return the time of a message in nanoseconds since the epoch."""
    if stamp.sec < 0:
        raise MessageError(f"{field}.sec", "no negative number", stamp.sec)
    if stamp.nanosec >= NANOSECONDS:
        raise MessageError(f"{field}.nanosec", f"0 to {NANOSECONDS - 1}", stamp.nanosec)
    return int(stamp.sec * NANOSECONDS + stamp.nanosec)


def to_header(grid_map: GridMap) -> "Header":
    """Return frame and time of a map as `std_msgs/Header`."""
    return messages_of("std_msgs").Header(
        stamp=to_stamp(grid_map.timestamp), frame_id=grid_map.frame_id
    )
