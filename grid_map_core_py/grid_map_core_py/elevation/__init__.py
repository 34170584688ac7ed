# SPDX-License-Identifier: BSD-3-Clause
"""Elevation maps that move with a robot.

`ElevationMapper` fuses scans of range sensors into heights with variances, and removes what beams
pass through; `Parameters` are its parameters, and an `UpdateReport` sums up one scan. Each sensor
has a `SensorModel` of its noise: `LaserModel`, `StructuredLightModel`, `StereoModel`,
`ConstantModel`, or `PerfectModel` for none.

`RollingMap` keeps the largest, smallest, mean or last height of each cell.
"""

from ._mapper import ElevationMapper as ElevationMapper, UpdateReport as UpdateReport
from ._parameters import (
    ConstantModel as ConstantModel,
    LaserModel as LaserModel,
    PerfectModel as PerfectModel,
    SensorModel as SensorModel,
    StereoModel as StereoModel,
    StructuredLightModel as StructuredLightModel,
)
from ._rolling_map import RollingMap as RollingMap

__all__ = [name for name in dir() if not name.startswith("_")]
