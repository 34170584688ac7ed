# SPDX-License-Identifier: BSD-3-Clause
"""Maps larger than memory, which Dask computes tile by tile.

`open_map` opens Zarr stores, GeoTIFF files and xarray datasets. This package requires the extra
`tiled`. GeoTIFF files also require the extra `geo`. `grid_map_core_py.xarray` registers the
accessor `grid_map` for xarray datasets.
"""

from .. import _lazy
from ._open import open_map as open_map
from ._tiled_map import TiledMap as TiledMap

__all__, __dir__ = _lazy.public_names(dir())
