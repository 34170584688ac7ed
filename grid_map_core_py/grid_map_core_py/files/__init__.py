# SPDX-License-Identifier: BSD-3-Clause
"""Loads and saves maps, and loads point clouds and meshes. The file name selects the format."""

from .. import _lazy
from ._clouds import (
    load_cloud as load_cloud,
    load_mesh as load_mesh,
    load_points as load_points,
)
from ._formats import (
    Format as Format,
    formats as formats,
    load as load,
    save as save,
)
from ._geotiff import load_geotiff as load_geotiff, save_geotiff as save_geotiff
from ._image_files import (
    load_height_image as load_height_image,
    save_height_image as save_height_image,
)
from ._map_server import load_map_server as load_map_server, save_map_server as save_map_server
from ._npz import load_npz as load_npz, save_npz as save_npz

__all__, __dir__ = _lazy.public_names(dir())
