# SPDX-License-Identifier: BSD-3-Clause
from grid_map_core_py._lazy import lazy_names
from grid_map_ros_py.nodes import quiet_start

quiet_start()

__all__, __getattr__, __dir__ = lazy_names(__name__, {})
