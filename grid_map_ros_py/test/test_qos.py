# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
import pytest
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSCompatibility, ReliabilityPolicy
from rclpy.qos import qos_check_compatible as check

from grid_map_ros_py.nodes import map_qos


def test_map_topics_keep_the_last_map_for_late_subscribers() -> None:
    qos = map_qos()
    assert qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert qos.reliability == ReliabilityPolicy.RELIABLE
    assert (qos.history, qos.depth) == (HistoryPolicy.KEEP_LAST, 1)


@pytest.mark.parametrize(
    ("published", "subscribed", "expected"),
    [
        (True, True, True),
        (True, False, True),
        (False, False, True),
        (False, True, False),
    ],
)
def test_transient_local_subscriber_needs_transient_local_publisher(
    published: bool, subscribed: bool, expected: bool
) -> None:
    profiles = (map_qos(transient_local=offered) for offered in (published, subscribed))
    assert (check(*profiles)[0] != QoSCompatibility.ERROR) == expected
