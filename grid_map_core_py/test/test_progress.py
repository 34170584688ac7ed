# SPDX-License-Identifier: BSD-3-Clause
"""The progress bar of the command line."""

import json
import sys
from types import SimpleNamespace

import pytest

from grid_map_core_py._commands import ProgressBar, _output


@pytest.fixture
def now(monkeypatch) -> list[float]:
    """Return a list whose only item is the time of the progress bar [s]."""
    now = [5.0]
    monkeypatch.setattr(_output, "time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


@pytest.mark.parametrize(
    ("done", "total", "seconds", "text"),
    [
        (0, 4, 0.0, f"[{'.' * 30}] 0/4 maps, 0 maps/s"),
        (1, 4, 2.0, f"[{'#' * 7}{'.' * 23}] 1/4 maps, 0.5 maps/s, 0:00:06 left"),
        (1, 3, 3700.0, f"[{'#' * 10}{'.' * 20}] 1/3 maps, 0.00027 maps/s, 2:03:20 left"),
        (4, 4, 2.0, f"[{'#' * 30}] 4/4 maps, 2 maps/s"),
        (0, 0, 1.0, f"[{'.' * 30}] 0/0 maps, 0 maps/s"),
        (7, None, 2.0, "7 maps, 3.5 maps/s"),
    ],
)
def test_progress_shows_count_rate_and_remaining_time(now, capsys, done, total, seconds, text):
    with ProgressBar() as bar:
        now[0] += seconds
        bar(done, total)
    assert capsys.readouterr().err == f"{text}\n"


def test_terminal_shows_one_line_that_is_overwritten(now, capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with ProgressBar(unit="tiles", cells=1e6) as bar:
        for done in range(6, 107):
            bar(done, 106)
            now[0] += 0.0625
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    shown = text.rstrip("\n").split("\r")
    # At most ten updates per second; the last state is always shown.
    assert 45 <= len(shown) <= 55
    assert shown[2].startswith(f"[{'#' * 2}{'.' * 28}] 8/106 tiles, 1.6e+07 cells/s, 0:00:06 left")
    assert shown[-1].startswith(f"[{'#' * 30}] 106/106 tiles, 1.58e+07 cells/s")


def test_progress_as_lines_of_json(now, capsys):
    with ProgressBar(unit="tiles", cells=100.0, as_json=True) as bar:
        for done in range(3, 9):
            bar(done, 8)
            now[0] += 0.5
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["tiles"] for line in lines] == [3, 5, 7, 8]
    assert lines[1] == {
        "tiles": 5,
        "of": 8,
        "seconds": 1.0,
        "cells_per_second": 200.0,
        "seconds_left": 1.5,
    }
