# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The set-up runs once, recovers from an interruption, and then needs no network."""

import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from scratch import BASE_PYTHON, ROOT, copy_tools, fresh_environment, offer_wheel, run

NO_NETWORK = {"PIP_NO_INDEX": "1", "PIP_CONFIG_FILE": os.devnull}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Path:
    """A workspace whose requirements are one empty wheel."""
    folder = copy_tools(tmp_path_factory.mktemp("workspace"))
    offer_wheel(folder / "wheels", "lark", "1.3.1")
    (folder / "tools" / "requirements.txt").write_text("lark==1.3.1\n")
    return folder


@pytest.fixture
def environ(workspace) -> dict[str, str]:
    wheels = str(workspace / "wheels")
    return fresh_environment(PYTHON=str(BASE_PYTHON), PIP_FIND_LINKS=wheels, **NO_NETWORK)


def start_setup(workspace: Path, environ: dict[str, str]) -> subprocess.Popen[str]:
    command = [workspace / "tools" / "workspace", "setup"]
    return subprocess.Popen(command, env=environ, stderr=subprocess.PIPE, text=True)


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_second_setup_at_once_waits_for_the_first(workspace, environ):
    both = [start_setup(workspace, environ) for _ in range(2)]
    told = sorted(setup.communicate(timeout=100)[1] for setup in both)
    assert [setup.returncode for setup in both] == [0, 0]
    assert told[0].startswith("Making .venv")
    assert told[1].startswith("Waiting for another")
    assert "Making" not in told[1]
    assert (workspace / ".venv" / ".complete").exists()


def test_killed_setup_starts_over(workspace, environ):
    venv = workspace / ".venv"
    python = venv / "bin" / "python"
    (venv / ".complete").unlink(missing_ok=True)
    (venv / "debris").touch()
    killed = start_setup(workspace, environ)
    wait_until(lambda: venv.exists() and not (venv / "debris").exists())
    wait_until(python.exists)
    killed.kill()
    killed.communicate()
    (venv / "debris").touch()
    assert not (venv / ".complete").exists()
    assert run(workspace / "tools/workspace", "setup", environ=environ).returncode == 0
    assert (venv / ".complete").exists()
    assert not (venv / "debris").exists()
    assert run(python, "-m", "pip", "show", "lark", environ=environ).returncode == 0


@pytest.mark.parametrize("command", ["setup", "build"])
def test_repeated_run_is_quick_silent_and_offline(command):
    started = time.monotonic()
    done = run(ROOT / "tools/workspace", command, environ={**os.environ, **NO_NETWORK})
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert time.monotonic() - started < 3.0
