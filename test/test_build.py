# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`make build` rebuilds changed packages only, and repairs an interrupted build."""

import os
import sys
from pathlib import Path

import pytest

from scratch import copy_tools, run

SETUP = """
from setuptools import setup
setup(
    name="tiny",
    packages=["tiny"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/tiny"]),
        ("share/tiny", ["package.xml"]),
    ],
)
"""
PACKAGE = """
<package format="3">
  <name>tiny</name>
  <version>0.1.0</version>
  <description>Next to nothing.</description>
  <maintainer email="nobody@example.com">nobody</maintainer>
  <license>BSD-3-Clause</license>
  <export><build_type>ament_python</build_type></export>
</package>
"""
BUILD = "import os, workspace; workspace.build(os.environ, 'fingerprint')"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Path:
    folder = copy_tools(tmp_path_factory.mktemp("workspace"))
    for path, text in {
        "tiny/setup.py": SETUP,
        "tiny/package.xml": PACKAGE,
        "tiny/resource/tiny": "",
        "tiny/tiny/__init__.py": "",
        "tiny/tiny/old.py": "",
    }.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    return folder


def build(workspace: Path) -> bool:
    """Build, and return whether anything was rebuilt."""
    environ = {**os.environ, "PYTHONPATH": f"{workspace}/tools:{os.environ['PYTHONPATH']}"}
    done = run(sys.executable, "-c", BUILD, environ=environ, cwd=workspace)
    assert done.returncode == 0, done.stderr
    return "Building tiny" in done.stderr


def installed(workspace: Path) -> set[str]:
    return {path.name for path in workspace.glob("install/tiny/lib/*/site-packages/tiny/*.py")}


def test_only_changes_are_built_and_nothing_stale_stays(workspace):
    assert build(workspace)
    assert installed(workspace) == {"__init__.py", "old.py"}
    assert not build(workspace)
    (workspace / "tiny/tiny/old.py").rename(workspace / "tiny/tiny/new.py")
    assert build(workspace)
    assert installed(workspace) == {"__init__.py", "new.py"}


def test_tests_and_caches_are_no_reason_to_build(workspace):
    build(workspace)
    for path in ("test/test_it.py", "tiny/__pycache__/old.pyc", ".hypothesis/example"):
        (workspace / "tiny" / path).parent.mkdir(parents=True, exist_ok=True)
        (workspace / "tiny" / path).write_text("")
    assert not build(workspace)


def test_build_without_stamp_is_repeated(workspace):
    build(workspace)
    next(workspace.glob("install/tiny/lib/*/site-packages/tiny/__init__.py")).unlink()
    (workspace / "install" / ".built.json").unlink()
    assert build(workspace)
    assert "__init__.py" in installed(workspace)
