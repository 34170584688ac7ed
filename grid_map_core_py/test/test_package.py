# SPDX-License-Identifier: BSD-3-Clause
"""Dependencies, lazy imports and docstring examples of the package."""

import doctest
import importlib
import pkgutil
import subprocess
import sys

import grid_map_core_py

MODULES = [
    module.name for module in pkgutil.walk_packages(grid_map_core_py.__path__, "grid_map_core_py.")
]


def test_no_module_needs_ros():
    blocked = "rclpy", "grid_map_msgs", "sensor_msgs", "std_msgs", "geometry_msgs"
    code = f"""
import sys
for name in {blocked!r}:
    sys.modules[name] = None
for name in {MODULES!r}:
    __import__(name)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_front_door_imports_conversions_and_files_on_use():
    code = """
import sys
import grid_map_core_py as gm, grid_map_core_py.tiled
assert not any(name.startswith("scipy") for name in sys.modules)
assert set(gm.__all__) <= set(dir(gm))
for name in gm.__all__:
    assert getattr(gm, name) is not None
assert gm.load is gm.files.load
assert gm.elevation.RollingMap
libraries = {"trimesh", "pypcd4", "rasterio", "xarray", "dask", "distributed", "zarr", "pyproj"}
assert not libraries & set(sys.modules)
try:
    gm.lod
except AttributeError as error:
    assert "has no attribute 'lod'; did you mean load?" in str(error)
assert not [name for name in dir(gm) if name.startswith("_")]
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_examples_in_the_docstrings_are_true():
    attempted = 0
    public = {name: getattr(grid_map_core_py, name) for name in grid_map_core_py.__all__}
    for name in MODULES:
        result = doctest.testmod(importlib.import_module(name), extraglobs=public)
        assert result.failed == 0, name
        attempted += result.attempted
    assert attempted > 0
