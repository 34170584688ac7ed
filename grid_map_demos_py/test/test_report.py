# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The table at the end of the demo."""

from pathlib import Path

from grid_map_core_py import GridMap
from grid_map_demos_py.report import Report


def test_the_report_tells_cells_layers_times_latency_and_messages():
    report = Report(["/in", "/out"])
    report.add_times({"inpaint": 2.0, "slope": 0.5})
    report.add_times({"inpaint": 4.0, "slope": 0.5})
    report.add_times({"inpaint": 3.0, "slope": 0.7})
    report.counts["/out"] = 7
    report.latency = 12.4
    report.files = [Path("demo_output/a.png")]
    text = report.to_text(GridMap((4, 3), 1.0, layers=["elevation", "slope"]))
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


def test_topics_without_enough_messages_are_missing():
    report = Report(["/in", "/out"])
    report.counts["/out"] = 4
    assert report.missing(5) == ["/in", "/out"]
    report.counts.update({"/in": 5, "/out": 6})
    assert report.missing(5) == []
