# SPDX-License-Identifier: BSD-3-Clause
"""The accessor `grid_map` of xarray: `import grid_map_core_py.xarray` adds it.

`GridMap.to_xarray`, `GridMap.from_xarray` and `open_map` add it, too. See `GridMapAccessor`.
"""

from contextlib import suppress

from .errors import MissingPackageError
from .tiled._tiled_map import GridMapAccessor as GridMapAccessor, register

__all__ = ["GridMapAccessor"]

with suppress(MissingPackageError):  # without xarray, there is nothing to add it to
    register()
