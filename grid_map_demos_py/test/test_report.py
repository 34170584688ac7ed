# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The tables at the end of the filters demo."""

from pathlib import Path

from grid_map_core_py import GridMap
from grid_map_demos_py.demo_report_node import report


def test_report_lists_cells_layers_times_latency_and_messages():
    grid_map = GridMap((4, 3), 1.0, layers=["elevation", "slope"])
    times = {"inpaint": [2.0, 4.0, 3.0], "slope": [0.5, 0.5, 0.7]}
    text = report(grid_map, times, 12.4, {"/in": 0, "/out": 7}, [Path("demo_output/a.png")])
    lines = [" ".join(line.split()) for line in text.splitlines()]
    for expected in [
        "cells 4 x 3 = 12",
        "layers 2",
        "inpaint 3.00",
        "slope 0.50",
        "whole chain 3.50",
        "published to filtered 12 ms",
        "/in 0",
        "/out 7",
        "demo_output/a.png",
    ]:
        assert expected in lines
