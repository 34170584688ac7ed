# SPDX-License-Identifier: BSD-3-Clause
"""Simulated range sensors over a map, for tests and demos of elevation mapping.

- `cast_rays` returns the ranges at which beams hit a terrain. The terrain is a height layer.
- `SpinningLidar` and `DepthCamera` compute the beam directions of a sensor.
- `scan` returns the points that a sensor measures. A sensor model of `grid_map_core_py.elevation`
  can add noise.
- `with_box`, `with_ramp` and `with_stairs` place objects on a terrain. To simulate a moving
  obstacle, place a box at a new center for each scan.
"""

from .. import _lazy
from ._objects import with_box as with_box, with_ramp as with_ramp, with_stairs as with_stairs
from ._rays import cast_rays as cast_rays
from ._sensors import DepthCamera as DepthCamera, SpinningLidar as SpinningLidar, scan as scan

__all__, __dir__ = _lazy.public_names(dir())
