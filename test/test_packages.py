# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Manifests, versions and message types of the packages are consistent."""

import ast
import importlib
import json
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from grid_map_msgs.srv import GetGridMap, GetGridMapInfo, ProcessFile, SetGridMap
from scratch import PACKAGES, PYTHON_PACKAGES, ROOT

ROSDEP_KEYS = {
    "contourpy": "python3-matplotlib",  # matplotlib depends on contourpy
    "cv2": "python3-opencv",
    "hypothesis": "python3-hypothesis",
    "lark": "python3-lark-parser",
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "pytest": "python3-pytest",
    "scipy": "python3-scipy",
    "yaml": "python3-yaml",
}
"""Under which key rosdep knows a module; ROS packages are known by the names of their modules."""

OPTIONAL = {"nav2_msgs", "numba", "octomap_msgs", "viser"}
"""Optional modules, imported on use; if one is missing, an error names the remedy."""


def by_name(path: Path) -> str:
    return path.name


def imports(folder: Path) -> set[str]:
    """Return the top-level modules that the Python files in `folder` import."""
    found = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                found.add(node.module.split(".")[0])
    return found - set(sys.stdlib_module_names)


def declared(package: Path, *tags: str) -> set[str]:
    manifest = ElementTree.parse(package / "package.xml").getroot()
    return {element.text for tag in tags for element in manifest.iter(tag)}


def keys(modules: set[str], package: Path) -> set[str]:
    helpers = {path.stem for path in (package / "test").rglob("*.py")}
    return {ROSDEP_KEYS.get(module, module) for module in modules - helpers - {package.name}}


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=by_name)
def test_package_declares_what_it_imports_and_nothing_else(package):
    used, used_by_tests = (
        keys(imports(package / folder), package) for folder in (package.name, "test")
    )
    run = declared(package, "depend", "exec_depend")
    optional = OPTIONAL | ({"python3-hypothesis"} & declared(package, "test_depend"))
    assert used - run - optional == set()
    assert used_by_tests - run - declared(package, "test_depend") == set()
    launched = {other.name for other in PACKAGES}
    assert declared(package, "exec_depend") - used - launched == set()


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=by_name)
def test_every_declared_executable_is_installed(package):
    entries = re.findall(r'"(\w+) = (\w+)\.([\w.]+):main"', (package / "setup.py").read_text())
    for executable, owner, module in entries:
        assert owner == package.name
        assert (package / owner / f"{module.replace('.', '/')}.py").exists()
        installed = ROOT / "install" / package.name / "lib" / package.name / executable
        assert installed.stat().st_mode & 0o111


@pytest.mark.parametrize("package", PACKAGES, ids=by_name)
def test_all_packages_carry_one_version(package):
    version = ElementTree.parse(package / "package.xml").getroot().findtext("version")
    assert version == "0.2.0"
    if package in PYTHON_PACKAGES:
        setup = (package / "setup.py").read_text()
        assert f'version="{version}"' in setup
        assert set(re.findall(r'"grid_map_\w+_py[^=]*=([\d.]+)"', setup)) <= {version}
        assert importlib.import_module(package.name).__version__ == version


def test_map_message_has_the_type_hash_of_cpp():
    """The hash is from bags that C++ nodes recorded; it covers all fields, nested ones too."""
    folder = ROOT / "install/grid_map_msgs/share/grid_map_msgs/msg"
    hashes = {
        entry["type_name"]: entry["hash_string"]
        for entry in json.loads((folder / "GridMap.json").read_text())["type_hashes"]
    }
    expected = "RIHS01_343b0e72887541beda6b035cc053f2d6fffaad9d6dcb2773c15a808dfca31fde"
    assert hashes["grid_map_msgs/msg/GridMap"] == expected


PLACE = "frame_id: string, position_x: double, position_y: double"


@pytest.mark.parametrize(
    ("message", "fields"),
    [
        (
            GetGridMap.Request,
            f"{PLACE}, length_x: double, length_y: double, layers: sequence<string>",
        ),
        (GetGridMap.Response, "map: grid_map_msgs/GridMap"),
        (GetGridMapInfo.Response, "info: grid_map_msgs/GridMapInfo"),
        (SetGridMap.Request, "map: grid_map_msgs/GridMap"),
        (ProcessFile.Request, "file_path: string, topic_name: string"),
        (ProcessFile.Response, "success: boolean"),
    ],
)
def test_services_have_the_fields_of_cpp_in_order(message, fields):
    found = message.get_fields_and_field_types()
    assert ", ".join(f"{name}: {kind}" for name, kind in found.items()) == fields
