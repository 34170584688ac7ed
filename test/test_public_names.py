# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Public modules list their names in `__all__`, and packages import only such names of others."""

import ast
import importlib
import importlib.util
from collections.abc import Iterator
from pathlib import Path

import pytest

from scratch import PYTHON_PACKAGES

LIBRARIES = [path for path in PYTHON_PACKAGES if path.name != "grid_map_demos_py"]
"""Packages that are imported; the demos are executables."""


def public_modules(package: Path) -> Iterator[str]:
    """Yield the modules and rooms of a package in whose dotted name no part is private."""
    for path in sorted((package / package.name).rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        parts = parts[:-1] if parts[-1] == "__init__" else parts
        if not any(part.startswith("_") for part in parts):
            yield ".".join(parts)


def names_not_exported(source: str, package: str) -> list[str]:
    """Return what code of `package` imports from sibling packages past their `__all__`."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.ImportFrom) or node.level or node.module is None:
            continue
        root = node.module.partition(".")[0]
        if root == package or root not in {path.name for path in PYTHON_PACKAGES}:
            continue
        exported = getattr(importlib.import_module(node.module), "__all__", ())
        for name in (alias.name for alias in node.names):
            full = f"{node.module}.{name}"
            if name not in exported and (name.startswith("_") or not is_module(full)):
                found.append(full)
    return found


def is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:  # its parent is a module, not a package
        return False


@pytest.mark.parametrize("package", LIBRARIES, ids=lambda path: path.name)
def test_public_modules_have_all(package):
    for name in public_modules(package):
        module = importlib.import_module(name)
        exported = getattr(module, "__all__", None)
        assert exported, f"{name}: list its public names in __all__, or let its name begin with _"
        assert [name for name in exported if name.startswith("_")] == []
        assert [name for name in exported if not hasattr(module, name)] == []


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=lambda path: path.name)
def test_packages_import_exported_names_of_siblings(package):
    sources = sorted((package / package.name).rglob("*.py"))
    found = {path.name: names_not_exported(path.read_text(), package.name) for path in sources}
    assert {name: names for name, names in found.items() if names} == {}


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("from grid_map_core_py import GridMap", []),
        ("from grid_map_core_py import testing", []),
        ("from grid_map_core_py.errors import GridMapError", []),
        ("from grid_map_ros_py.messages._time import to_time", []),
        ("from grid_map_core_py.errors import Any", ["grid_map_core_py.errors.Any"]),
        ("from grid_map_core_py.errors import _text", ["grid_map_core_py.errors._text"]),
        ("from grid_map_core_py.map import _geometry", ["grid_map_core_py.map._geometry"]),
    ],
)
def test_import_past_all_of_sibling_is_found(code, found):
    assert names_not_exported(code, "grid_map_ros_py") == found
