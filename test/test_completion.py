# SPDX-License-Identifier: BSD-3-Clause
"""Completion in real shells."""

import os
import re
import subprocess
from pathlib import Path

import pytest

from grid_map_core_py import GridMap
from grid_map_core_py.files import save_npz
from grid_map_ros_py import BagWriter

pytestmark = pytest.mark.needs("argcomplete")

ASK = """
eval "$(register-python-argcomplete grid-map)"
COMP_LINE=$1 COMP_POINT=${#1} COMP_TYPE=9
read -ra COMP_WORDS <<<"$1"
COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
_python_argcomplete grid-map
printf '%s\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("completion")
    save_npz(GridMap((1, 1), 0.5, layers=("elevation", "variance", "color")), path / "site.npz")
    with BagWriter(path / "survey") as bag:
        bag.write("/one", GridMap((1, 1), 0.5, layers=["elevation"]))
        bag.write("/other", GridMap((1, 1), 0.5, layers=["height"]))
    return path


def shell(folder: Path, *command: str) -> str:
    scripts = Path(__file__).parents[1] / "grid_map_core_py" / "scripts"
    environ = {**os.environ, "PATH": f"{scripts}:{os.environ['PATH']}"}
    done = subprocess.run(
        command, cwd=folder, env=environ, capture_output=True, text=True, timeout=60, check=False
    )
    return done.stdout


COMMANDS = "info inspect convert submap path doctor filter play plot record topics view"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("grid-map in", "info inspect"),
        ("grid-map info s", "site.npz survey/"),
        ("grid-map inspect site.npz --layer ", "elevation variance color"),
        ("grid-map plot survey map.png --topic /other --layer he", "height"),
        ("grid-map inspect survey --topic ", "/one /other"),
        (
            "grid-map convert site.npz --to ",
            "bag npz geotiff height_image map_server rrd zarr",
        ),
        ("grid-map ", f"{COMMANDS} --version -h --help"),
        ("grid-map plot site.npz --color-map vir", "viridis"),
        ("grid-map inspect broken.npz --layer ", ""),
    ],
)
def test_bash_completes(line, expected, folder):
    assert sorted(shell(folder, "bash", "-c", ASK, "bash", line).split()) == sorted(
        expected.split()
    )


def test_zsh_completes(folder):
    """In the words of the shell's own script, so that the machine needs no zsh."""
    script = shell(folder, "register-python-argcomplete", "--shell", "zsh", "grid-map")
    assert "compdef _python_argcomplete grid-map" in script
    ask = """
    export COMP_LINE="grid-map inspect site.npz --layer var" _ARGCOMPLETE=1 _ARGCOMPLETE_SHELL=zsh
    COMP_POINT=${#COMP_LINE} grid-map 8>&1 9>&2 >/dev/null
    """
    assert re.match(r"variance\b", shell(folder, "bash", "-c", ask))
