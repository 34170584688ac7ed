# SPDX-License-Identifier: BSD-3-Clause
"""Helpers that run the command line, as a process or within the test process."""

import os
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.testing import moved_in_buffer

PROGRAM = Path(__file__).parents[1] / "scripts" / "grid-map"

SECOND = 1_000_000_000


def grid_map(
    *words: str | Path, cwd: Path, stdin: bytes = b"", environ: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[bytes]:
    """Run `grid-map words`."""
    command = [str(PROGRAM), *map(str, words)]
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8", **(environ or {})}
    return subprocess.run(
        command, cwd=cwd, input=stdin, env=environment, capture_output=True, timeout=60, check=False
    )


def printed(*words: str | Path, cwd: Path, **options: object) -> str:
    """Run `grid-map words`, which must succeed, and return its output."""
    done = grid_map(*words, cwd=cwd, **options)
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout.decode()


def a_map(second: int = 3, layer: str = "elevation") -> GridMap:
    """Return a map that has moved, with a hole, an infinity and colors."""
    options = {"position": (1.0, 2.0), "frame_id": "odom", "timestamp": second * SECOND}
    made = GridMap((0.8, 0.6), 0.1, layers=(layer, "variance", "color"), **options)
    x, y = made.axes()
    made[layer] = second * (x[:, None] - 0.5 * y)
    made[layer][2, 3:5] = np.nan
    made["variance"] = 0.25
    made["variance"][0, 0] = np.inf
    made["color"] = np.array(0x00FF8000, np.uint32).view(np.float32)
    made.basic_layers = [layer]
    return moved_in_buffer(made, (3, 1))
