# SPDX-License-Identifier: BSD-3-Clause
from grid_map_ros_py.nodes import quiet_start

quiet_start()
