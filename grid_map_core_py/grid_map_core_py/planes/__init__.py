# SPDX-License-Identifier: BSD-3-Clause
"""Planar regions, which describe the flat parts of a map for foothold planning.

- `extract_planes` returns the `PlanarRegions` of a map. Regions keep their ids from map to map.
- `PlanarRegion`: a plane with covariance, an outer polygon and holes.
- `convex_inside`: a large convex polygon inside a region.
- `PlaneParameters`: thresholds, which can be read from the file `parameters.yaml` of the ROS
  package convex_plane_decomposition.
"""

from .. import _lazy
from ._convex import convex_inside as convex_inside
from ._extraction import extract_planes as extract_planes
from ._parameters import PlaneParameters as PlaneParameters
from ._regions import PlanarRegion as PlanarRegion, PlanarRegions as PlanarRegions

__all__, __dir__ = _lazy.public_names(dir())
