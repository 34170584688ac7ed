# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps, point clouds and meshes in files: `load` and `save` choose the format by the name."""

from ._atomic import new_file, new_folder
from ._clouds import Fields, load_cloud, load_mesh, load_points
from ._formats import (
    Format,
    MapRecord,
    find_format,
    formats,
    load,
    options_of,
    save,
)
from ._geotiff import load_geotiff, save_geotiff
from ._image_files import load_height_image, save_height_image
from ._image_folder import load_images, save_images
from ._map_server import load_map_server, save_map_server
from ._npz import load_npz, save_npz
from ._shared import load_yaml, map_facts, storage_errors

__all__ = [
    "Fields",
    "Format",
    "MapRecord",
    "find_format",
    "formats",
    "load",
    "load_cloud",
    "load_geotiff",
    "load_height_image",
    "load_images",
    "load_map_server",
    "load_mesh",
    "load_npz",
    "load_points",
    "load_yaml",
    "map_facts",
    "new_file",
    "new_folder",
    "options_of",
    "save",
    "save_geotiff",
    "save_height_image",
    "save_images",
    "save_map_server",
    "save_npz",
    "storage_errors",
]
