# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Files of points and meshes where the optional packages that read them are not installed."""

import subprocess
import sys

import pytest

from grid_map_core_py import MissingPackageError
from grid_map_core_py.files import load_mesh, load_points


@pytest.mark.parametrize(
    ("package", "name", "load"), [("pypcd4", "a.pcd", load_points), ("trimesh", "a.stl", load_mesh)]
)
def test_a_package_that_is_not_installed_is_named(tmp_path, monkeypatch, package, name, load):
    path = tmp_path / name
    path.write_text("hello")
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackageError, match=rf"{name}: .* pip install {package}"):
        load(path)


def test_the_packages_are_loaded_only_when_needed():
    code = "import sys, grid_map_core_py.files; assert not {'trimesh', 'pypcd4'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
