# SPDX-License-Identifier: BSD-3-Clause
"""Building blocks for ROS nodes: map topics, quality of service, parameters and life cycle.

The following node multiplies the heights of each received map by a factor:

    from rclpy.node import Node
    from grid_map_msgs.msg import GridMap as GridMapMessage
    from grid_map_ros_py import to_message
    from grid_map_ros_py.nodes import MapSubscription, map_qos, read_parameter, run

    class Scaler(Node):
        def __init__(self):
            super().__init__("scaler")
            self.factor = read_parameter(self, "factor", float, 1.0, description="height scale")
            self.publisher = self.create_publisher(GridMapMessage, "scaled_map", map_qos())
            self.subscription = MapSubscription(self, "grid_map", self.on_map)

        def on_map(self, received):
            grid_map = received.decode()
            grid_map["elevation"] *= self.factor
            self.publisher.publish(to_message(grid_map))

    if __name__ == "__main__":
        raise SystemExit(run(Scaler))

`run` ends the node on Ctrl-C and returns the exit code.
"""

import signal
import sys
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from grid_map_core_py._lazy import lazy_names

if TYPE_CHECKING:
    from grid_map_core_py._arrays import keep_memory as keep_memory

    from ._parameters import (
        read_parameter as read_parameter,
        read_parameter_tree as read_parameter_tree,
    )
    from ._spin import (
        ConfiguredNode as ConfiguredNode,
        run as run,
    )
    from ._topics import (
        MapPublisher as MapPublisher,
        MapSubscription as MapSubscription,
        map_qos as map_qos,
    )

_OFFERED = {
    "grid_map_core_py._arrays": "keep_memory",
    "._parameters": "read_parameter read_parameter_tree",
    "._spin": "ConfiguredNode run",
    "._topics": "MapPublisher MapSubscription map_qos",
}
_LAZY, __getattr__, __dir__ = lazy_names(__name__, _OFFERED)

__all__ = sorted(["quiet_start", *_LAZY])


def quiet_start() -> None:
    """Let Ctrl-C end an executable during startup, without a traceback.

    Call this function in the `__init__.py` of the package that contains the executables, before
    rclpy is imported. The import takes most of the startup time. `run` later installs its own
    signal handling. If ROS 2 is not sourced, a one-line error replaces the traceback. The function
    has no effect if another program imports the package.
    """
    # Executables start with SIGINT blocked, because Python itself would print a traceback.
    is_executable = signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])
    # This is true while `python -m` imports the package of the module that it will run.
    is_executable |= sys.argv[0] == "-m"
    if is_executable:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        sys.excepthook = _report


def _report(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> None:
    """Print one line if ROS 2 is missing, and a traceback for other errors."""
    if isinstance(error, ModuleNotFoundError) and find_spec("rclpy") is None:
        text = f"{error}. Source ROS 2, then the workspace"
        print(f"{Path(sys.argv[0]).name}: {text}", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, traceback)
