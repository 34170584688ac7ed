# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The progress bar of the command line."""

import io
from itertools import pairwise

import pytest

from grid_map_core_py.commands import ProgressBar
from grid_map_core_py.commands._output import progress_text


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
    assert progress_text(done, total, seconds) == text


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
