# SPDX-License-Identifier: BSD-3-Clause
"""The progress bar of the command line."""

import io
import json
from itertools import pairwise

import pytest

from grid_map_core_py.commands import ProgressBar
from grid_map_core_py.commands._output import Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("done", "total", "seconds", "text"),
    [
        (0, 4, 0.0, f"[{'.' * 30}] 0/4 maps, 0.0 maps/s"),
        (1, 4, 2.0, f"[{'#' * 7}{'.' * 23}] 1/4 maps, 0.5 maps/s, 0:06 left"),
        (10, 400, 1.5, f"[{'.' * 30}] 10/400 maps, 6.7 maps/s, 0:58 left"),
        (1, 200, 1.0, f"[{'.' * 30}] 1/200 maps, 1.0 maps/s, 3:19 left"),
        (4, 4, 2.0, f"[{'#' * 30}] 4/4 maps, 2.0 maps/s"),
        (0, 0, 1.0, f"[{'#' * 30}] 0/0 maps, 0.0 maps/s"),
        (7, None, 2.0, "7 maps, 3.5 maps/s"),
    ],
)
def test_progress_shows_count_rate_and_remaining_time(done, total, seconds, text):
    assert Progress(done, total, seconds).text() == text


def test_terminal_shows_one_line_that_is_overwritten():
    terminal = Terminal()
    now = [100.0]
    with ProgressBar(terminal, lambda: now[0]) as bar:
        for done in range(1, 101):
            now[0] += 0.0625
            bar(done, 100)
    assert terminal.getvalue().count("\n") == 1
    shown = terminal.getvalue().rstrip("\n").split("\r")
    # At most ten updates per second; the last state is always shown.
    assert 45 <= len(shown) <= 55
    assert shown[-1].strip() == f"[{'#' * 30}] 100/100 maps, 16.0 maps/s"
    # Spaces overwrite the rest of the longer line.
    assert all(len(after) >= len(before.rstrip()) for before, after in pairwise(shown))


def test_tiles_show_cells_per_second_of_this_run_only():
    terminal = Terminal()
    now = [100.0]
    with ProgressBar(terminal, lambda: now[0], unit="tiles", cells=1e6) as bar:
        now[0] += 50.0
        bar(6, 20)
        now[0] += 2.0
        bar(10, 20)
    shown = terminal.getvalue().rstrip("\n").split("\r")
    assert shown[-1] == f"[{'#' * 15}{'.' * 15}] 10/20 tiles, 2 million cells/s, 0:05 left"


def test_hours_are_left():
    assert Progress(1, 3, 3700.0).text().endswith(", 2:03:20 left")


def test_progress_as_lines_of_json():
    stream, now = io.StringIO(), [0.0]
    with ProgressBar(stream, lambda: now[0], unit="tiles", cells=100.0, as_json=True) as bar:
        for done in range(3, 9):
            bar(done, 8)
            now[0] += 0.5
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [line["tiles"] for line in lines] == [3, 5, 7, 8]
    assert lines[1] == {
        "tiles": 5,
        "of": 8,
        "seconds": 1.0,
        "cells_per_second": 200.0,
        "seconds_left": 1.5,
    }
