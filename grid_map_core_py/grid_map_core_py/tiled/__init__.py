# SPDX-License-Identifier: BSD-3-Clause
"""Maps larger than memory: tiles in Zarr stores and GeoTIFF files, computed by Dask.

Requires the extra `tiled`, and `geo` for GeoTIFF. `grid_map_core_py.xarray` adds the accessor
`grid_map` to datasets.
"""

from ._open import open_map as open_map
from ._tiled_map import TiledMap as TiledMap

__all__ = [name for name in dir() if not name.startswith("_")]
