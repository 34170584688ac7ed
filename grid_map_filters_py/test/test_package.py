# SPDX-License-Identifier: BSD-3-Clause
"""Dependencies and docstring examples of the package."""

import doctest
import importlib
import pkgutil
import subprocess
import sys

import grid_map_filters_py

MODULES = [
    module.name
    for module in pkgutil.walk_packages(grid_map_filters_py.__path__, "grid_map_filters_py.")
    if "._executables" not in module.name
]


def test_only_executables_need_ros():
    blocked = "rclpy", "grid_map_msgs", "grid_map_ros_py", "diagnostic_msgs", "std_msgs"
    code = f"""
import sys
for name in {blocked!r}:
    sys.modules[name] = None
for name in {MODULES!r}:
    __import__(name)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_docstring_examples_are_true():
    attempted = 0
    for name in MODULES:
        result = doctest.testmod(importlib.import_module(name))
        assert result.failed == 0, name
        attempted += result.attempted
    assert attempted > 0
