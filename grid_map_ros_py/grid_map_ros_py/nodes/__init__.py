# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Parts of ROS nodes: parameters, quality of service, map subscriptions, process life, logs."""

from ._parameters import check_topic, read_parameter, read_parameter_tree, read_positive
from ._qos import map_qos
from ._spin import run
from ._subscription import LatchedSubscription, MapSubscription
from ._tf_poses import TfPoses, has_tf
from ._throttle import LogThrottle

__all__ = [
    "LatchedSubscription",
    "LogThrottle",
    "MapSubscription",
    "TfPoses",
    "check_topic",
    "has_tf",
    "map_qos",
    "read_parameter",
    "read_parameter_tree",
    "read_positive",
    "run",
]
