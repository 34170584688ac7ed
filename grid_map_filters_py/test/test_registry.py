# SPDX-License-Identifier: BSD-3-Clause
"""Filters of other packages, through entry points; dependencies and examples of this package."""

import doctest
import importlib
import os
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import grid_map_filters_py
from grid_map_filters_py._registry import BUILT_IN, FILTERS

MODULE = """
from dataclasses import dataclass

@dataclass(frozen=True, kw_only=True)
class Lift:
    layer: str
    height: float = 1.0

    def __call__(self, grid_map):
        return grid_map.with_layers({self.layer: grid_map[self.layer] + self.height})
"""

USE = """
from grid_map_core_py import GridMap
from grid_map_filters_py import FilterChain
step = {"name": "up", "type": "lift/LiftFilter", "params": {"layer": "elevation", "height": 2}}
result = FilterChain.from_config([step])(GridMap((1, 1), 0.5, layers={"elevation": 3.0}))
print(float(result["elevation"][0, 0]))
"""


def install(folder: Path, entry: str) -> None:
    (folder / "lift_filters.py").write_text(MODULE)
    info = folder / "lift_filters-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lift-filters\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[grid_map_filters_py.filters]\n{entry}\n")


def run_python(folder: Path, code: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(folder), *sys.path])
    environment = {**os.environ, "PYTHONPATH": path}
    return subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60
    )


def test_filter_of_another_package_is_found_by_type(tmp_path):
    install(tmp_path, "lift/LiftFilter = lift_filters:Lift")
    result = run_python(tmp_path, USE)
    assert result.stdout.strip() == "5.0", result.stderr


def test_error_names_entry_point_that_is_no_filter(tmp_path):
    install(tmp_path, "lift/LiftFilter = lift_filters:dataclass")
    result = run_python(tmp_path, USE)
    assert result.returncode == 1
    assert "FilterConfigError: filter 1 'up' (lift/LiftFilter): " in result.stderr


@pytest.mark.parametrize("type_name", BUILT_IN)
def test_built_in_filters_have_three_spellings(type_name):
    name = type_name.partition("/")[2]
    short = name.removesuffix("Filter")
    assert short == BUILT_IN[type_name].__name__
    for spelling in (f"gridMapFilters/{name}", f"gridMapCv/{name}", short):
        assert FILTERS[spelling] is BUILT_IN[type_name]
    listed = [one for one in FILTERS.types if one.endswith((f"/{name}", short))]
    assert listed == [type_name]


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
