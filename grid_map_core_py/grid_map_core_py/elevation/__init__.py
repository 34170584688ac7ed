# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Elevation maps that move with a robot: `RollingMap` fuses successive point clouds."""

from ._rolling_map import RollingMap

__all__ = [
    "RollingMap",
]
