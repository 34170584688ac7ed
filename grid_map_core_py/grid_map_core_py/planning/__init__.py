# SPDX-License-Identifier: BSD-3-Clause
"""Footprints of robots on a map, and least-cost paths.

- `Footprint`: the outline of a robot.
- `footprint_cells`: the cells that a footprint touches at a pose.
- `check_pose`, `check_path`: whether the robot may stand at a pose or move along a path. They
  return a `PoseCheck` and a `PathCheck`.
- `footprint_layer`: a statistic of the values under the footprint, at every cell and in several
  directions.
- `TravelGraph`: the moves of a robot between cells. `TravelGraph.path` returns a least-cost `Path`.
- `CostField`: the cost from every cell to the nearest goal, as returned by `TravelGraph.cost_to`.
- `SlopeLimits`: the steepest slopes up, down and across.
- `NoPathError`: raised if a start or goal is not free, or if no path exists. Its `reason` is a
  `PathFailure`, which is an error code of Nav2.
"""

from .. import _lazy
from ._checks import (
    PathCheck as PathCheck,
    PoseCheck as PoseCheck,
    check_path as check_path,
    check_pose as check_pose,
    footprint_cells as footprint_cells,
)
from ._footprint import Footprint as Footprint, footprint_layer as footprint_layer
from ._graph import (
    CostField as CostField,
    NoPathError as NoPathError,
    Path as Path,
    PathFailure as PathFailure,
    TravelGraph as TravelGraph,
)
from ._ground import SlopeLimits as SlopeLimits

__all__, __dir__ = _lazy.public_names(dir())
