# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Quality of service of map topics."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


def map_qos(*, transient_local: bool = True) -> QoSProfile:
    """Return the profile of topics that carry maps: reliable, and only the last map matters.

    Args:
        transient_local: the publisher keeps the last map for subscribers that come late (a latched
            topic), and a subscriber asks for it. Publishers of maps always do. A subscriber that
            should also hear volatile publishers must give it up (False), and misses earlier maps.
    """
    durability = DurabilityPolicy.TRANSIENT_LOCAL if transient_local else DurabilityPolicy.VOLATILE
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=durability,
    )
