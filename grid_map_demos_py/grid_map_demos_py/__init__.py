# SPDX-License-Identifier: BSD-3-Clause
from grid_map_ros_py.nodes import quiet_start

__version__ = "0.2.0"

quiet_start()
