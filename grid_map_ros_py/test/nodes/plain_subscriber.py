# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Print the first map on /grid_map as JSON, with plain rclpy and the messages alone."""

import json
import sys

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from grid_map_msgs.msg import GridMap


def print_map(message: GridMap) -> None:
    layout = message.data[0].layout
    described = {
        "frame_id": message.header.frame_id,
        "stamp": [message.header.stamp.sec, message.header.stamp.nanosec],
        "position": [message.info.pose.position.x, message.info.pose.position.y],
        "layers": list(message.layers),
        "dims": [[dim.label, dim.size, dim.stride] for dim in layout.dim],
        "start_index": [message.outer_start_index, message.inner_start_index],
        "data": [str(value) for value in message.data[0].data],
    }
    print(json.dumps(described), flush=True)


def main() -> None:
    rclpy.init()
    node = Node("subscriber")
    durability = DurabilityPolicy[sys.argv[1]]
    received = rclpy.task.Future()
    node.create_subscription(
        GridMap, "/grid_map", received.set_result, QoSProfile(depth=1, durability=durability)
    )
    print("subscribed", flush=True)
    rclpy.spin_until_future_complete(node, received)
    print_map(received.result())
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    assert not any(name.startswith(("grid_map_core_py", "grid_map_ros_py")) for name in sys.modules)
    main()
