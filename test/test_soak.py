# SPDX-License-Identifier: BSD-3-Clause
"""The program of `make soak`, for some seconds; memory still grows then."""

import os
import re
import sys
from pathlib import Path

import pytest

from scratch import ROOT, run

sys.path.append(str(ROOT / "benchmarks"))

import soak

LOOSE = ("--growth", "100", "--gap", "60")
"""Limits for some seconds on a busy machine."""

NODES = ("elevation_mapping", "filter_chain", "grid_map_server", "web_viewer")


def test_soak_of_some_seconds_meets_its_figures():
    command = (sys.executable, ROOT / "benchmarks" / "soak.py", "--seconds", "6", "--nodes", *NODES)
    done = run(*command, *LOOSE, environ=os.environ)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "filter_chain" in done.stdout
    assert done.stdout.endswith("all figures are met\n")


@pytest.fixture
def finished(tmp_path: Path) -> soak.Soak:
    """Return a soak of ten minutes with one node that has met its figures."""
    run_of_one = soak.Soak(None, tmp_path, 600.0)
    subject = soak.Subject("a.node", {}, "/in", "/out", counts=(95, 93, 2))
    # A message is on its way in some pauses.
    for number, (begin, _) in enumerate(run_of_one._pauses()):
        subject.samples[begin] = (51.0 if number in (2, 5, 7) else 50.0), 9
    for number in range(1, 94):
        subject.note(1000.0 + number, number, 0.0)
    run_of_one.subjects[:] = [subject]
    run_of_one.sent, run_of_one.bad = {"/in": 100}, {"/in": 2}
    run_of_one._undisturbed = 0.0
    run_of_one._begin -= 600
    return run_of_one


def problems(finished: soak.Soak) -> list[str]:
    found = [*finished.miscounts(), *finished.leaks(0.01), *finished.gaps(1094.0)]
    return [text for text in found if "browser" not in text]


def test_good_figures_of_a_soak_are_no_problem(finished):
    assert problems(finished) == []


def test_leaks_of_a_soak_are_problems(finished):
    (subject,) = finished.subjects
    for begin, (memory, files) in subject.samples.items():
        minutes = begin / 60 - 2
        subject.samples[begin] = memory + 0.1 * minutes, files + round(minutes / 4)
    found = [re.sub(r"[\d.]+", "*", text) for text in problems(finished)]
    assert found == ["node: * MB more than *", "node: * files more than *"]


@pytest.mark.parametrize("counts", [(95, 92, 2), (101, 99, 2), (0, 0, 0)])
def test_miscounts_of_a_soak_are_problems(finished, counts):
    (subject,) = finished.subjects
    subject.counts, subject.published = counts, counts[1]
    assert any("sent" in text for text in problems(finished))


def test_gaps_between_maps_of_a_soak_are_problems(finished):
    (subject,) = finished.subjects
    subject.note(1096.5, 94, earliest=1094.0)
    subject.note(1097.0, 95, earliest=0.0)
    assert not [*finished.gaps(1097.0)]
    assert [*finished.gaps(1100.0)] == ["node: 3.0 s without a map, until 600 s"]
    subject.note(1101.0, 96, earliest=0.0)
    assert [*finished.gaps(1111.0)] == ["node: 10.0 s without a map, until 600 s"]
