# SPDX-License-Identifier: BSD-3-Clause
"""Elevation maps that move with a robot.

`ElevationMapper` fuses range sensor scans into heights with variances, and clears cells that beams
pass through. `UpdateReport` summarizes one update.

The sensor noise models are `LaserModel`, `StructuredLightModel`, `StereoModel`, `ConstantModel` and
`PerfectModel` (no noise). A custom noise model implements `SensorModel`.

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
