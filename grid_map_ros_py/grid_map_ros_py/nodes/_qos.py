# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Quality of service of map topics."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


def map_qos(*, transient_local: bool = True) -> QoSProfile:
    """Return the quality of service of map topics: reliable, latched, depth 1.

    Args:
        transient_local: whether the publisher keeps the last map for late subscribers (a latched
            topic), and a subscriber requests it. Publishers of maps always do. A subscriber with
            False also receives from volatile publishers, but no earlier map.
    """
    durability = DurabilityPolicy.TRANSIENT_LOCAL if transient_local else DurabilityPolicy.VOLATILE
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=durability,
    )
