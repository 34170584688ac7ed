# SPDX-License-Identifier: BSD-3-Clause
"""Registers the accessor `grid_map` of xarray datasets and arrays when imported.

The accessor reads, filters, crops, samples and plots data that `GridMap.from_xarray` accepts.
`GridMap.to_xarray`, `GridMap.from_xarray` and `open_map` also register the accessor.
"""

from contextlib import suppress

from .errors import MissingPackageError
from .tiled._tiled_map import GridMapAccessor as GridMapAccessor, register

__all__ = ["GridMapAccessor"]

with suppress(MissingPackageError):  # xarray is not installed
    register()
