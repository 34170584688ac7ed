# SPDX-License-Identifier: BSD-3-Clause
"""Footprints of robots on a map, and least-cost paths.

- `Footprint`: the outline of a robot.
- `TravelGraph` connects the free cells of a map. `TravelGraph.path` returns the least-cost `Path`
  between two positions; `TravelGraph.cost_to` returns a `CostField`, the cost from every cell to
  the nearest goal. `SlopeLimits` are the steepest slopes up, down and sideways.
- `NoPathError` is raised if a start or a goal is not free, or if no path exists. Its `reason` is a
  `PathFailure`, which has the error codes of Nav2.
"""

from typing import TYPE_CHECKING

from .._lazy import lazy_names

if TYPE_CHECKING:
    from ._footprint import Footprint as Footprint
    from ._graph import SlopeLimits as SlopeLimits, TravelGraph as TravelGraph
    from ._paths import (
        CostField as CostField,
        NoPathError as NoPathError,
        Path as Path,
        PathFailure as PathFailure,
    )

_OFFERED = {
    "._footprint": "Footprint",
    "._graph": "SlopeLimits TravelGraph",
    "._paths": "CostField NoPathError Path PathFailure",
}
# Footprints need no SciPy.
__all__, __getattr__, __dir__ = lazy_names(__name__, _OFFERED)
