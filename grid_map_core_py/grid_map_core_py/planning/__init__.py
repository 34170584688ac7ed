# SPDX-License-Identifier: BSD-3-Clause
"""Footprints of robots on a map.

- `Footprint`: the outline of a robot; `footprint_cells`: the cells that it touches at a pose.
- `check_pose`, `check_path`: whether the robot may stand at a pose or move along a path. The
  results are a `PoseCheck` and a `PathCheck`.
- `footprint_layer`: lowest, mean or highest value under the footprint at every cell, for several
  directions.
"""

from typing import TYPE_CHECKING

from .._lazy import lazy_names

if TYPE_CHECKING:
    from ._checks import (
        PathCheck as PathCheck,
        PoseCheck as PoseCheck,
        check_path as check_path,
        check_pose as check_pose,
        footprint_cells as footprint_cells,
    )
    from ._footprint import Footprint as Footprint
    from ._footprint_layer import footprint_layer as footprint_layer

_OFFERED = {
    "._checks": "PathCheck PoseCheck check_path check_pose footprint_cells",
    "._footprint": "Footprint",
    "._footprint_layer": "footprint_layer",
}
# Paths need SciPy, which is slow to import.
__all__, __getattr__, __dir__ = lazy_names(__name__, _OFFERED)
