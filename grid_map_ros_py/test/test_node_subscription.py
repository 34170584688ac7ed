# SPDX-License-Identifier: BSD-3-Clause
"""Subscriptions that deliver undecoded maps."""

import pytest
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy
from test_grid_map import sample_map

from grid_map_core_py.testing import assert_maps_equal
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import ReceivedMap, to_message, to_serialized_message
from grid_map_ros_py.nodes import MapSubscription, map_qos
from grid_map_ros_py.testing import Peer


def test_map_topics_keep_the_last_map_for_late_subscribers() -> None:
    qos = map_qos()
    assert (qos.history, qos.depth) == (HistoryPolicy.KEEP_LAST, 1)
    assert qos.reliability == ReliabilityPolicy.RELIABLE
    assert qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_maps_arrive_undecoded_until_the_subscription_is_given_up(other_side: Peer) -> None:
    received: list[ReceivedMap] = []
    subscription = MapSubscription(other_side.node, "/map", received.append)
    other_side.publish("/map", to_message(sample_map()))
    other_side.wait_until(lambda: received, "the map")
    assert received[0].data[:4] == b"\0\1\0\0"
    assert received[0].data.startswith(to_serialized_message(sample_map())[:40])
    assert_maps_equal(received[0].decode(), sample_map())
    subscription.destroy()
    subscription.destroy()
    other_side.wait_until(
        lambda: not other_side.node.count_subscribers("/map"), "the subscription to go"
    )


def test_subscription_adopts_the_quality_of_known_publishers(other_side: Peer) -> None:
    node, warned, received = other_side.node, [], []
    events = PublisherEventCallbacks(incompatible_qos=warned.append)
    volatile = map_qos(transient_local=False)
    publisher = node.create_publisher(GridMapMessage, "/map", volatile, event_callbacks=events)
    other_side.wait_until(lambda: node.get_publishers_info_by_topic("/map"), "the publisher")
    subscription = MapSubscription(node, "/map", received.append)
    other_side.wait_until(publisher.get_subscription_count, "the subscription")
    publisher.publish(to_message(sample_map()))
    other_side.wait_until(lambda: received, "the map")
    assert not warned
    subscription.destroy()


def test_given_quality_of_service_stays(
    other_side: Peer, capfd: pytest.CaptureFixture[str]
) -> None:
    volatile = map_qos(transient_local=False)
    publisher = other_side.node.create_publisher(GridMapMessage, "/map", volatile)
    subscription = MapSubscription(other_side.node, "/map", print, qos=map_qos())
    text = ""

    def has_warned() -> bool:
        nonlocal text
        text += capfd.readouterr().err
        return "no messages from a publisher of /map" in text and "durability" in text

    other_side.wait_until(has_warned, "a warning")
    assert publisher.get_subscription_count() == 0
    subscription.destroy()
