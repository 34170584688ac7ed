# SPDX-License-Identifier: BSD-3-Clause
"""Set-up and build: one at a time, repeated after an interruption, then silent and offline."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from scratch import BASE_PYTHON, ROOT, copy_tools, fresh_environment, offer_wheel, run

NO_NETWORK = {"PIP_NO_INDEX": "1", "PIP_CONFIG_FILE": os.devnull}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Path:
    """A workspace whose requirements are empty wheels."""
    folder = copy_tools(tmp_path_factory.mktemp("workspace"))
    for name, wheel in (("requirements", "lark"), ("requirements-build", "wheel")):
        requirement = offer_wheel(folder / "wheels", wheel, "1.3.1")
        (folder / "tools" / f"{name}.txt").write_text(requirement)
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
    (workspace / ".venv" / ".complete").unlink(missing_ok=True)
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
    venv.mkdir(exist_ok=True)
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


def test_other_contents_under_the_same_name_are_refused(workspace, environ):
    file = workspace / "tools" / "requirements.txt"
    right = file.read_text()
    found = right.rpartition(":")[2].strip()
    file.write_text(right.replace(found, "0" * 64))
    done = run(workspace / "tools/workspace", "setup", environ=environ)
    file.write_text(right)
    assert done.returncode == 1
    reason = rf"DO NOT MATCH THE HASHES.*Expected sha256 0{{64}}\s+Got\s+{found}"
    assert re.search(reason, done.stderr, re.DOTALL)
    assert not (workspace / ".venv" / ".complete").exists()


@pytest.mark.parametrize("name", ["", "-build", "-docs", "-oldest"])
def test_pinned_files_hold_what_their_lists_ask_for(name):
    pins = (ROOT / "tools" / f"requirements{name}.in").read_text().lower().splitlines()
    text = (ROOT / "tools" / f"requirements{name}.txt").read_text()
    for pin in pins:
        wanted = re.sub(r"\[.*\]", "", pin).replace("_", "-")
        assert wanted.startswith("#") or not wanted or f"\n{wanted} " in f"\n{text}", pin
    # Every requirement has hashes; neither an index nor an address stands there.
    hashed = re.findall(r"^\S+==\S+ .*\\\n    --hash=sha256:", text, re.MULTILINE)
    assert len(hashed) == len(re.findall(r"^\S", text, re.MULTILINE))
    assert not re.search(r"^\s*-(?!-hash=)|://", text, re.MULTILINE)


@pytest.mark.parametrize("command", ["setup", "build"])
def test_repeated_run_is_silent_and_offline(command):
    done = run(ROOT / "tools/workspace", command, environ={**os.environ, **NO_NETWORK})
    # The test of `make demo` may hold the lock.
    others = "Waiting for another set-up or build of this workspace ...\n"
    assert (done.returncode, done.stdout, done.stderr.removeprefix(others)) == (0, "", "")


def test_make_check_runs_all_tools_and_names_those_that_fail(tmp_path):
    for tool in ("ruff", "mypy", "lint-imports", "python3"):
        (tmp_path / tool).write_text(f"#!/bin/sh\necho $0 $1; [ {tool} = mypy ]\n")
        (tmp_path / tool).chmod(0o755)
    enter = f"ENTER=PATH={tmp_path}:$$PATH &&"
    done = run("make", "--no-print-directory", "-o", "build", "check", enter, environ=os.environ)
    assert done.returncode
    *ran, last = done.stdout.replace(f"{tmp_path}/", "").splitlines()
    assert [line.split()[0] for line in ran] == [
        *("ruff", "ruff", "mypy", "mypy", "lint-imports", "python3")
    ]
    assert last == "failed: ruff check, ruff format, lint-imports, python3 tools/api.py"


SLOW = """
import sys, steps
steps.PERIOD = 0.2
steps.run(sys.executable, "-uc", sys.argv[1], environ={}, takes_long=True)
"""


@pytest.mark.parametrize("end", ["", "sys.exit('no compiler')"])
def test_long_step_shows_its_progress_and_why_it_fails(end):
    program = f"import sys, time; print('begun'); print('[ 40%] Built'); time.sleep(1); {end}"
    environ = {**os.environ, "PYTHONPATH": str(ROOT / "tools")}
    done = run(sys.executable, "-c", SLOW, program, environ=environ)
    assert re.search(r"^ +\d s  \[ 40%\] Built$", done.stderr, re.MULTILINE)
    assert (done.stdout, done.returncode) == ("", 1 if end else 0)
    assert ("no compiler" in done.stderr, "begun\n" in done.stderr) == (bool(end), bool(end))


# --- builds: of changed packages only -------------------------------------------------------------

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


@pytest.fixture
def tiny(tmp_path) -> Path:
    folder = copy_tools(tmp_path)
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


def build(tiny: Path) -> bool:
    """Build, and return whether anything was rebuilt."""
    environ = {**os.environ, "PYTHONPATH": f"{tiny}/tools:{os.environ['PYTHONPATH']}"}
    done = run(sys.executable, "-c", BUILD, environ=environ, cwd=tiny)
    assert done.returncode == 0, done.stderr
    return "Building tiny" in done.stderr


def installed(tiny: Path) -> set[str]:
    return {path.name for path in tiny.glob("install/tiny/lib/*/site-packages/tiny/*.py")}


def test_only_changes_are_built_and_nothing_stale_stays(tiny):
    assert build(tiny)
    assert installed(tiny) == {"__init__.py", "old.py"}
    for path in ("test/test_it.py", "tiny/__pycache__/old.pyc", ".hypothesis/example"):
        (tiny / "tiny" / path).parent.mkdir(parents=True, exist_ok=True)
        (tiny / "tiny" / path).write_text("")
    assert not build(tiny)
    (tiny / "tiny/tiny/old.py").rename(tiny / "tiny/tiny/new.py")
    assert build(tiny)
    assert installed(tiny) == {"__init__.py", "new.py"}
    # Without its stamp, a build is repeated.
    next(tiny.glob("install/tiny/lib/*/site-packages/tiny/__init__.py")).unlink()
    (tiny / "install" / ".built.json").unlink()
    assert build(tiny)
    assert "__init__.py" in installed(tiny)
