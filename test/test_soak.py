# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The program of `make soak`, for some seconds; memory still grows then."""

import os
import sys

from scratch import ROOT, run


def test_soak_of_some_seconds_meets_its_figures():
    program = ROOT / "benchmarks" / "soak.py"
    done = run(sys.executable, program, "--seconds", "6", "--growth", "100", environ=os.environ)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "filter_chain" in done.stdout
    assert done.stdout.endswith("all figures are met\n")
