# SPDX-License-Identifier: BSD-3-Clause
"""Costs of the node `costmap`: checks, windows and the transform to another frame."""

import math

import numpy as np
import pytest
from nav2_stand_in import PyCostmap2D  # noqa: F401

from grid_map_core_py import GridMap, GridMapError
from grid_map_core_py.regions import Polygon
from grid_map_ros_py._costs import Planar, aligned, check_costs, planar, resampled
from grid_map_ros_py.nodes._poses import from_xyz_rpy
