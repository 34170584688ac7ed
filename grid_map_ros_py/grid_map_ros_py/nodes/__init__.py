# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Parts of ROS nodes: map subscriptions, quality of service, parameters, process life, logs.

A complete node, which hears every reliable publisher of maps and publishes scaled maps:

    from rclpy.node import Node
    from grid_map_msgs.msg import GridMap as GridMapMessage
    from grid_map_ros_py import to_message
    from grid_map_ros_py.nodes import MapSubscription, map_qos, read_parameter, run

    class Scaler(Node):
        def __init__(self):
            super().__init__("scaler")
            self.factor = read_parameter(self, "factor", float, 1.0, description="of the heights")
            self.publisher = self.create_publisher(GridMapMessage, "scaled_map", map_qos())
            self.subscription = MapSubscription(self, "grid_map", self.on_map)

        def on_map(self, received):
            grid_map = received.decode()
            grid_map["elevation"] *= self.factor
            self.publisher.publish(to_message(grid_map))

    if __name__ == "__main__":
        raise SystemExit(run(Scaler))

`run` ends the node on Ctrl-C and returns the exit code. All names are loaded on first use, since
rclpy takes long to import.
"""

import importlib
import sys
from types import TracebackType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._configured import ConfiguredNode
    from ._health import Health, health_of
    from ._parameters import (
        check_topic,
        read_parameter,
        read_parameter_tree,
        read_positive,
        read_topic,
    )
    from ._profile import use_profile
    from ._spin import run, steady_timer
    from ._tf_poses import TfPoses, has_tf
    from ._throttle import LogThrottle
    from ._topics import LatchedSubscription, MapSubscription, map_qos, warn_of_gaps

__all__ = [
    "ConfiguredNode",
    "Health",
    "LatchedSubscription",
    "LogThrottle",
    "MapSubscription",
    "TfPoses",
    "check_topic",
    "has_tf",
    "health_of",
    "map_qos",
    "quiet_start",
    "read_parameter",
    "read_parameter_tree",
    "read_positive",
    "read_topic",
    "run",
    "steady_timer",
    "use_profile",
    "warn_of_gaps",
]


_MODULES = (
    "_throttle",
    "_profile",
    "_health",
    "_topics",
    "_parameters",
    "_spin",
    "_configured",
    "_tf_poses",
)
"""Modules in which a name is searched when it is first used; the first two need no rclpy."""


def quiet_start() -> None:
    """Let Ctrl-C end this process without a traceback where nothing else handles it.

    Call it where a package of executables begins, before rclpy is imported: importing takes most of
    the time in which an executable starts. `run` handles interrupts afterwards.
    """

    def report(
        kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        if not issubclass(kind, KeyboardInterrupt):
            sys.__excepthook__(kind, error, trace)

    sys.excepthook = report


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    modules = (importlib.import_module(f".{module}", __name__) for module in _MODULES)
    value = next(getattr(module, name) for module in modules if hasattr(module, name))
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
