# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Each check of `make check` detects the mistake that it is meant to detect."""

import os
import shutil
import sys
from pathlib import Path

import pytest

from scratch import PYTHON_PACKAGES, ROOT, copy_tools, run

LICENCE = "# Copyright (c) 2026 grid_map_py contributors\n# SPDX-License-Identifier: BSD-3-Clause\n"


@pytest.fixture
def workspace(tmp_path) -> Path:
    """A workspace of packages that contain only the modules that the tests add."""
    copy_tools(tmp_path)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for package in PYTHON_PACKAGES:
        (tmp_path / package.name / package.name).mkdir(parents=True)
        (tmp_path / package.name / package.name / "__init__.py").touch()
        (tmp_path / package.name / "setup.py").touch()
    return tmp_path


def broken_contracts(workspace: Path, module: str, code: str) -> str:
    """Return the broken contracts of a module with this code."""
    package, _, name = module.partition(".")
    path = workspace / package / package / f"{name.replace('.', '/')}.py"
    path.parent.mkdir(exist_ok=True)
    (path.parent / "__init__.py").touch()
    path.write_text(code)
    sources = [workspace / "tools", *(workspace / path.name for path in PYTHON_PACKAGES)]
    path = ":".join([*map(str, sources), os.environ["PYTHONPATH"]])
    environ = {**os.environ, "PYTHONPATH": path}
    done = run("lint-imports", "--no-cache", environ=environ, cwd=workspace)
    assert done.returncode == (1 if "BROKEN" in done.stdout else 0), done.stderr
    return "".join(line for line in done.stdout.splitlines() if "BROKEN" in line)


@pytest.mark.parametrize(
    ("module", "imported", "complaint"),
    [
        ("grid_map_core_py.layer", "sensor_msgs.msg", "The core knows no ROS"),
        ("grid_map_core_py.layer", "grid_map_ros_py", "Packages stand on each other"),
        ("grid_map_filters_py.threshold", "grid_map_ros_py", "The filters know no ROS"),
        ("grid_map_ros_py.messages._image", "rclpy", "Nodes are leaves"),
        ("grid_map_demos_py.move", "grid_map_demos_py.move_node", "Nodes are leaves"),
        (
            "grid_map_filters_py.threshold",
            "grid_map_filters_py._executables.chain",
            "Nodes are leaves",
        ),
        ("grid_map_ros_py.messages", "grid_map_core_py._arrays", "Private modules stay inside"),
        ("grid_map_filters_py._executables.filter_chain", "grid_map_ros_py, rclpy", ""),
    ],
)
def test_import_against_the_rules_is_found(workspace, module, imported, complaint):
    (workspace / "grid_map_demos_py/grid_map_demos_py/move_node.py").touch()
    for private in ("grid_map_core_py/_arrays", "grid_map_filters_py/_executables/chain"):
        path = workspace / private.partition("/")[0] / f"{private}.py"
        path.parent.mkdir(exist_ok=True)
        (path.parent / "__init__.py").touch()
        path.touch()
    broken = broken_contracts(workspace, module, f"import {imported}\n")
    assert broken.startswith(complaint)
    assert bool(broken) == bool(complaint)


@pytest.mark.parametrize(("code", "found"), [("", True), (LICENCE, False)])
def test_file_without_licence_header_is_found(workspace, code, found):
    (workspace / "tools" / "new.py").write_text(f'{code}"""Add."""\n\nSUM = 1 + 1\n')
    command = ("check", "--no-cache", "--output-format=concise", "tools/new.py")
    done = run("ruff", *command, environ=os.environ, cwd=workspace)
    assert ("CPY001" in done.stdout or "copyright" in done.stdout) == found, done.stdout


def results(workspace: Path, suite: str, *cases: str) -> None:
    path = workspace / "build" / suite / "pytest.xml"
    path.parent.mkdir(parents=True, exist_ok=True)
    tests = "".join(f'<testcase classname="c" name="n">{case}</testcase>' for case in cases)
    path.write_text(f"<testsuites><testsuite>{tests}</testsuite></testsuites>")


def count(workspace: Path) -> tuple[int, str]:
    tool = workspace / "tools" / "test_results.py"
    done = run(sys.executable, tool, "count", environ=os.environ, cwd=workspace)
    return done.returncode, done.stdout.splitlines()[-1]


def test_the_tests_of_all_suites_are_counted(workspace):
    for suite in ("workspace", *(path.name for path in PYTHON_PACKAGES)):
        results(workspace, suite, "", "<skipped/>")
    suites = len(PYTHON_PACKAGES) + 1
    assert count(workspace) == (0, f"{suites} passed, 0 failed, {suites} skipped")
    results(workspace, "workspace", "<failure/>", "<error/>")
    assert count(workspace) == (1, f"{suites - 1} passed, 2 failed, {suites - 1} skipped")


def test_suite_without_tests_has_failed(workspace):
    for package in PYTHON_PACKAGES:
        results(workspace, package.name, "")
    assert count(workspace) == (1, f"{len(PYTHON_PACKAGES)} passed, 1 failed, 0 skipped")
