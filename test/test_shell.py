# SPDX-License-Identifier: BSD-3-Clause
"""`. tools/env.sh` puts a shell into the environment, and `tools/run` starts executables."""

import os
import shutil
import signal
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from grid_map_ros_py.testing import Process, wait_until
from scratch import PYTHON_PACKAGES, ROOT, run

SHELLS = [shell for shell in ("bash", "zsh") if shutil.which(shell)]
IMPORTS = "import rclpy, grid_map_msgs.msg, " + ", ".join(path.name for path in PYTHON_PACKAGES)


@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_anywhere_finds_python_colcon_and_our_packages(shell, tmp_path):
    script = f". {ROOT}/tools/env.sh && command -v colcon && python -c '{IMPORTS}'"
    done = run(shell, "-c", script, environ=os.environ, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("shell", SHELLS)
def test_sourcing_twice_changes_nothing(shell):
    show = "env | grep -E '^(PATH|.*_PATH|PYTHONPATH)=' | sort"
    script = f". {ROOT}/tools/env.sh; {show}; echo --; . {ROOT}/tools/env.sh; {show}"
    once, twice = run(shell, "-c", script, environ=os.environ).stdout.split("--\n")
    assert once == twice
    path = next(line for line in once.splitlines() if line.startswith("PYTHONPATH="))
    entries = path.removeprefix("PYTHONPATH=").split(":")
    assert len(entries) == len(set(entries))


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.parametrize("options", ["set -eu", "set +eu"])
def test_the_shell_keeps_its_options_arguments_and_functions(shell, options):
    script = f'{options}; b=$-; . {ROOT}/tools/env.sh; echo "$b $- $*"; typeset -f | grep _grid_map'
    done = run(shell, "-c", script, "name", "one", "two", environ=os.environ)
    before, after, *arguments = done.stdout.split()
    assert before == after
    assert arguments == ["one", "two"]


def test_unknown_executable_is_answered_with_known_ones(tmp_path):
    started = run(ROOT / "tools/run", "grid_map_filters_py", "x", environ=os.environ, cwd=tmp_path)
    assert started.returncode == 1
    assert "no executable 'x'" in started.stderr.lower()
    assert "filter_chain" in started.stderr


def run_installed(
    prefix: Path, package: str, program: str, *arguments: str
) -> CompletedProcess[str]:
    """Start a program through tools/run, as an executable of an installed package."""
    path = prefix / "lib" / package / "tell"
    path.parent.mkdir(parents=True)
    path.write_text(f"#!/bin/bash\n{program}\n")
    path.chmod(0o755)
    script = f'. tools/env.sh; export AMENT_PREFIX_PATH="{prefix}:$AMENT_PREFIX_PATH"; exec "$@"'
    command = ("bash", "-c", script, "bash", "tools/run", package, "tell", *arguments)
    return run(*command, environ=os.environ, cwd=Path(ROOT))


def test_executable_gets_arguments_and_returns_its_exit_code(tmp_path):
    program = 'echo "$2"\nexit 7'
    done = run_installed(tmp_path, "some_package", program, "a", "b c")
    assert (done.returncode, done.stdout) == (7, "b c\n")


def test_executable_starts_without_blocked_signals(tmp_path):
    program = "sed -n 's/^SigBlk:\\t//p' /proc/self/status"
    done = run_installed(tmp_path, "grid_map_new_py", program)
    assert int(done.stdout, 16) == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_ends_run_and_its_setup_at_once(number, tmp_path):
    shutil.copytree(ROOT / "tools", tmp_path / "tools")
    (tmp_path / "tools" / "env.sh").write_text("echo $$ >&2; exec sleep 600\n")
    process = Process([str(tmp_path / "tools" / "run"), "some_package", "tell"])
    wait_until(lambda: process.lines, "the set-up")
    process.send_signal(number)
    assert process.wait() == -number
    setup = Path("/proc", process.text.strip(), "cmdline")
    # A process that has ended may still be listed.
    wait_until(lambda: not (setup.exists() and setup.read_text()), "the end of the set-up")
