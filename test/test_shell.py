# SPDX-License-Identifier: BSD-3-Clause
"""`. tools/env.sh` puts a shell into the environment, and `tools/run` starts executables."""

import os
import shutil
import signal
from pathlib import Path

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
def test_colcon_in_the_shell_may_write_byte_code(shell):
    script = f". {ROOT}/tools/env.sh && python -c 'import sys; print(sys.dont_write_bytecode)'"
    done = run(shell, "-c", script, environ={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"})
    assert done.stdout == "False\n"


@pytest.mark.parametrize("shell", SHELLS)
def test_sourcing_twice_changes_nothing(shell):
    show = "env | grep -E '^(PATH|.*_PATH|PYTHONPATH)=' | sort"
    script = f". {ROOT}/tools/env.sh; {show}; echo --; . {ROOT}/tools/env.sh; {show}"
    once, twice = run(shell, "-c", script, environ=os.environ).stdout.split("--\n")
    assert once == twice


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.parametrize("options", ["set -eu", "set +eu"])
def test_the_shell_keeps_its_options_arguments_and_functions(shell, options):
    script = f'{options}; b=$-; . {ROOT}/tools/env.sh; echo "$b $- $*"; typeset -f | grep _grid_map'
    done = run(shell, "-c", script, "name", "one", "two", environ=os.environ)
    before, after, *arguments = done.stdout.split()
    assert before == after
    assert arguments == ["one", "two"]


@pytest.mark.parametrize(("words", "opens"), [("", False), ("VIEW=0", False), ("VIEW=1", True)])
def test_demo_opens_a_view_only_if_wanted(words, opens):
    done = run("make", "-n", "demo", *words.split(), environ=os.environ)
    assert ("_demo --view" in done.stdout, "--report" in done.stdout) == (opens, not opens)


def test_unknown_executable_is_answered_with_known_ones(tmp_path):
    started = run(ROOT / "tools/run", "grid_map_filters_py", "x", environ=os.environ, cwd=tmp_path)
    assert started.returncode == 1
    assert "no executable 'x'" in started.stderr.lower()
    assert "filter_chain" in started.stderr


def test_executable_gets_arguments_and_an_unblocked_signal_mask(tmp_path):
    """A program started with tools/run, as an executable of an installed package."""
    path = tmp_path / "lib" / "some_package" / "tell"
    path.parent.mkdir(parents=True)
    path.write_text("#!/bin/bash\necho $2\nsed -n 's/^SigBlk:\\t//p' /proc/self/status\nexit 7\n")
    path.chmod(0o755)
    script = f'. tools/env.sh; export AMENT_PREFIX_PATH="{tmp_path}:$AMENT_PREFIX_PATH"; exec "$@"'
    command = ("bash", "-c", script, "bash", "tools/run", "some_package", "tell", "a", "b c")
    done = run(*command, environ=os.environ, cwd=Path(ROOT))
    argument, blocked = done.stdout.splitlines()
    assert (done.returncode, argument, int(blocked, 16)) == (7, "b c", 0)


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
