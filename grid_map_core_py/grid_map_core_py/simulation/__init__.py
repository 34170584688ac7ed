# SPDX-License-Identifier: BSD-3-Clause
"""Simulated range sensors over a map, for tests and demos of elevation mapping.

- `cast_rays` returns where beams meet a layer of heights, which is the true terrain.
- `SpinningLidar` and `DepthCamera` hold the beam directions of a sensor, and `scan` returns
  the points that the sensor measures, with the noise of a sensor model from `elevation`.
- `with_box`, `with_ramp` and `with_stairs` place objects on a terrain; a box with a new center for
  each scan is a moving obstacle.
"""

from ._objects import with_box as with_box, with_ramp as with_ramp, with_stairs as with_stairs
from ._rays import cast_rays as cast_rays
from ._sensors import DepthCamera as DepthCamera, SpinningLidar as SpinningLidar, scan as scan

__all__ = [name for name in dir() if not name.startswith("_")]
