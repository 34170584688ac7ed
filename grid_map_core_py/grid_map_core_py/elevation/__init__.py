# SPDX-License-Identifier: BSD-3-Clause
"""Elevation maps that move with a robot.

`ElevationMapper` fuses scans of range sensors into heights with variances. It clears cells that
beams have passed through. `UpdateReport` summarizes one update.

The noise models of sensors are `LaserModel`, `StructuredLightModel`, `StereoModel`, `ConstantModel`
and `PerfectModel` (no noise). To write another noise model, implement `SensorModel`.

`RollingMap` keeps the largest, smallest, mean or last height in each cell.
"""

from .. import _lazy
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

__all__, __dir__ = _lazy.public_names(dir())
