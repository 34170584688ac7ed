# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""If a prerequisite is missing, the set-up stops at once and names it in one sentence."""

import shutil
from pathlib import Path

import pytest

from scratch import BASE_PYTHON, SHELL_PROGRAMS, copy_tools, fresh_environment, run


@pytest.fixture
def workspace(tmp_path) -> Path:
    return copy_tools(tmp_path / "workspace")


def refusal(workspace: Path, *prefix: str, **changes: object) -> str:
    """Return the one sentence with which the set-up refuses, with changes of the environment."""
    changes = {name: str(value) for name, value in changes.items()}
    environ = fresh_environment(**{"PYTHON": str(BASE_PYTHON), **changes})
    done = run(*prefix, workspace / "tools" / "workspace", "setup", environ=environ)
    assert done.returncode == 1
    assert done.stdout == ""
    (sentence,) = done.stderr.splitlines()
    assert not (workspace / ".venv").exists()
    return sentence


def bare_path(folder: Path) -> Path:
    """Return a folder that offers a shell and nothing to build with."""
    folder.mkdir()
    for program in SHELL_PROGRAMS:
        (folder / program).symlink_to(shutil.which(program))
    return folder


def fake_python(path: Path, version: str) -> Path:
    path.write_text(f"#!/bin/sh\necho {version}\n")
    path.chmod(0o755)
    return path


@pytest.mark.parametrize("version", ["3.10", "3.13", "2.7"])
def test_old_or_new_python_is_refused(workspace, tmp_path, version):
    python = fake_python(tmp_path / "python3", version)
    sentence = refusal(workspace, PYTHON=python)
    assert "needs Python 3.11 or 3.12" in sentence
    assert f"{python} is {version}" in sentence


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"PYTHON": "/nowhere/python3"}, "/nowhere/python3 cannot be run"),
        ({"ROS_DISTRO": "humble"}, "'humble' is sourced"),
    ],
)
def test_variable_that_makes_no_sense_is_named(workspace, changes, text):
    assert text in refusal(workspace, **changes)


def test_fitting_python_on_the_path_is_found_or_missed(workspace, tmp_path):
    folder = bare_path(tmp_path / "bin")
    fake_python(folder / "python3", "3.9")
    sentence = refusal(workspace, PATH=folder, PYTHON="")
    assert "python3 is 3.9" in sentence
    assert "apt install" in sentence
    (folder / BASE_PYTHON.name).symlink_to(BASE_PYTHON)
    assert "lacks cmake" in refusal(workspace, PATH=folder, PYTHON="")


def test_no_cmake_and_no_compilers(workspace, tmp_path):
    sentence = refusal(workspace, PATH=bare_path(tmp_path / "bin"))
    assert "lacks cmake, make, a C compiler, a C++ compiler" in sentence
    assert "apt install cmake make gcc g++)" in sentence


def test_no_venv_module(workspace, tmp_path):
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['ensurepip'] = None\n")
    assert "apt install python3-venv" in refusal(workspace, PYTHONPATH=tmp_path)


def test_a_machine_without_wheels(workspace):
    sentence = refusal(workspace, "setarch", "i686")
    assert "x86-64 Linux only" in sentence
    assert "i686" in sentence


def test_a_sourced_ros_whose_python_is_hidden(workspace, tmp_path):
    folder = bare_path(tmp_path / "bin")
    (folder / "python3").symlink_to(BASE_PYTHON)
    ros = {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": "/opt/ros/jazzy"}
    assert "cannot import its rclpy" in refusal(workspace, PATH=folder, PYTHON="", **ros)


def test_a_path_with_spaces(tmp_path):
    assert "without spaces" in refusal(copy_tools(tmp_path / "my robot"))


def test_shell_of_workspace_that_is_not_set_up(workspace):
    done = run("bash", "-c", f". {workspace}/tools/env.sh", environ=fresh_environment())
    assert done.returncode == 1
    assert done.stderr == (
        f"{workspace} is not set up for a shell without ROS: run `make build` there first.\n"
    )
