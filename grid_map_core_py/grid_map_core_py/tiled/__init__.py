# SPDX-License-Identifier: BSD-3-Clause
"""Maps larger than memory: tiles in Zarr stores and GeoTIFF files, computed by Dask.

Needs the extra `tiled`; GeoTIFF needs `geo`, too. `grid_map_core_py.xarray` adds the accessor
`grid_map` to datasets.
"""

from ._open import open_map as open_map
from ._source import (
    Source as Source,
    Window as Window,
    shape as shape,
    widened as widened,
    within as within,
)
from ._tiled_map import TiledMap as TiledMap

__all__ = [name for name in dir() if not name.startswith("_")]
