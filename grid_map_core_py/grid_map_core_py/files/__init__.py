# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps, point clouds and meshes in files, and files that appear complete or not at all."""

from ._atomic import find_folder, new_file, new_folder
from ._clouds import Fields, load_mesh, load_points
from ._image_folder import load_images, save_images
from ._npz import load_npz, save_npz, storage_errors
from ._yaml_files import load_yaml

__all__ = [
    "Fields",
    "find_folder",
    "load_images",
    "load_mesh",
    "load_npz",
    "load_points",
    "load_yaml",
    "new_file",
    "new_folder",
    "save_images",
    "save_npz",
    "storage_errors",
]
