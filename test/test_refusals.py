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


BUILDERS = {"cmake": "cmake", "make": "make", "cc": "a C compiler", "c++": "a C++ compiler"}
"""Programs that builds need, and how the set-up calls them."""


def bare_path(folder: Path, *programs: str) -> Path:
    """Return a folder that offers a shell and some stand-ins of programs."""
    folder.mkdir()
    for program in SHELL_PROGRAMS:
        (folder / program).symlink_to(shutil.which(program))
    for program in programs:
        fake(folder / program, "")
    return folder


def fake(path: Path, script: str) -> Path:
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path


def user(folder: Path, number: int) -> Path:
    """Return a folder for PYTHONPATH that makes Python take its user for this one."""
    (folder / "sitecustomize.py").write_text(f"import os\nos.geteuid = lambda: {number}\n")
    return folder


@pytest.mark.parametrize("version", ["3.10", "3.13", "2.7"])
def test_old_or_new_python_is_refused(workspace, tmp_path, version):
    python = fake(tmp_path / "python3", f"echo {version}")
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
    fake(folder / "python3", "echo 3.9")
    sentence = refusal(workspace, PATH=folder, PYTHON="")
    assert "python3 is 3.9" in sentence
    assert "apt install" in sentence
    (folder / BASE_PYTHON.name).symlink_to(BASE_PYTHON)
    assert "lacks cmake" in refusal(workspace, PATH=folder, PYTHON="")


@pytest.mark.parametrize("hidden", [*BUILDERS, ""])
def test_each_missing_program_is_named(workspace, tmp_path, hidden):
    others = BUILDERS.keys() - {hidden} if hidden else ()
    sentence = refusal(workspace, PATH=bare_path(tmp_path / "bin", *others))
    lacking = [BUILDERS[hidden]] if hidden else BUILDERS.values()
    assert f"This machine lacks {', '.join(lacking)}: install what is missing" in sentence
    assert hidden or "apt install cmake make gcc g++)" in sentence


def test_no_venv_module(workspace, tmp_path):
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['ensurepip'] = None\n")
    path = bare_path(tmp_path / "bin", *BUILDERS)
    assert "apt install python3-venv" in refusal(workspace, PATH=path, PYTHONPATH=tmp_path)


APT = """
echo "$@" >>{log}
if [ "$1" = install ]; then
    for program in cmake make cc c++; do ln -s "$(command -v true)" {folder}/$program; done
fi
"""


@pytest.mark.parametrize("number", [0, 1000])
def test_only_root_gets_missing_programs_installed(workspace, tmp_path, number):
    folder, log = bare_path(tmp_path / "bin", "true"), tmp_path / "log"
    fake(folder / "ln", f'exec {shutil.which("ln")} "$@"')
    fake(folder / "apt-get", APT.format(log=log, folder=folder))
    changes = {"PATH": str(folder), "PYTHONPATH": str(user(tmp_path, number))}
    environ = fresh_environment(PYTHON=str(BASE_PYTHON), PIP_NO_INDEX="1", **changes)
    done = run(workspace / "tools" / "workspace", "setup", environ=environ)
    # Without an index pip fails, after the check of the machine.
    assert done.returncode == 1
    if number:
        assert "lacks cmake, make, a C compiler, a C++ compiler: install" in done.stderr
        assert not log.exists()
    else:
        assert done.stderr.startswith(
            "Installing cmake make gcc g++ with apt-get ...\nMaking .venv"
        )
        install = "install -qq -y --no-install-recommends cmake make gcc g++"
        assert log.read_text().splitlines() == ["update -qq", install]


def test_root_gets_python_where_there_is_none(workspace, tmp_path):
    folder, log = bare_path(tmp_path / "bin"), tmp_path / "log"
    fake(folder / "id", "echo 0")
    link = f"{shutil.which('ln')} -sf {BASE_PYTHON} {folder}/python3"
    fake(folder / "apt-get", f'echo "$@" >>{log}; [ "$1" = update ] || {link}')
    environ = fresh_environment(PATH=str(folder), PYTHONPATH=str(user(tmp_path, 1000)))
    done = run(workspace / "tools" / "workspace", "setup", environ=environ)
    told, refused = done.stderr.splitlines()
    assert told == "Installing python3 python3-venv python3-dev with apt-get ..."
    assert "lacks cmake" in refused
    assert log.read_text().startswith("update -qq\ninstall -qq -y --no-install-recommends python3 ")


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
