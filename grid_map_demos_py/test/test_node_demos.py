# SPDX-License-Identifier: BSD-3-Clause
"""The demos as users start them: real processes over DDS."""

import os
import re
import signal
import sys
import uuid
from contextlib import suppress
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
from demos import parameters, published
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from grid_map_core_py import GridMap
from grid_map_core_py.testing import assert_maps_equal
from grid_map_demos_py import launcher
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, to_message
from grid_map_ros_py.testing import Process, peer, start_node, wait_until

FILTERS_DEMO = ("grid_map_demos_py.launcher", "filters_demo")
REPORT = ("grid_map_demos_py.report_node", "filters")
PNG = b"\x89PNG\r\n"


def living(mark: str) -> list[str]:
    """Return the command lines of processes with the given mark in their environment."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # The process has ended, or belongs to another user.
            if mark.encode() in (process / "environ").read_bytes():
                found.append((process / "cmdline").read_bytes().replace(b"\0", b" ").decode())
    return found


def pythons(mark: str) -> list[str]:
    """Return the marked processes that already run Python, without the `env` that starts them."""
    return [command for command in living(mark) if command.startswith(sys.executable)]


def start_marked(*arguments: str) -> tuple[Process, str]:
    mark = uuid.uuid4().hex
    command = [sys.executable, "-m", *FILTERS_DEMO, *arguments]
    return Process(command, {"GRID_MAP_DEMO_MARK": mark}), mark


def ends(demo: Process, mark: str, code: int) -> None:
    """Interrupt a demo, and check that it leaves no process and no traceback."""
    demo.send_signal(signal.SIGINT)
    assert demo.wait() == code, demo.text
    wait_until(lambda: not living(mark), "the end of the processes")
    assert "Traceback" not in demo.text, demo.text


def test_simple_demo_publishes_a_moving_wave():
    maps, _ = published("simple_demo", count=10)
    assert maps[0].size == (40, 67)
    assert maps[0].layers == ("elevation",)
    assert maps[0].frame_id == "map"
    assert not np.array_equal(maps[0]["elevation"], maps[-1]["elevation"])
    # Along x the wave is a straight line through -0.04 m in the middle.
    middle = maps[-1].get_submap((0.0, 0.0), (0.06, 2.0))["elevation"]
    np.testing.assert_allclose(middle.mean(axis=0), -0.04, atol=1e-6)


def test_terrain_publisher_follows_its_parameters(terrain):
    given = ["resolution:=1", "topic:=/ground", "frame_id:=odom"]
    (grid_map, *_), _ = published("terrain_publisher", *given, topic="/ground")
    assert (grid_map.resolution, grid_map.frame_id) == (1.0, "odom")
    grid_map = grid_map.with_layers({"elevation": grid_map["elevation"] * np.float32(0.03)})
    np.testing.assert_allclose(grid_map["elevation"], terrain["elevation"], rtol=1e-5)
    assert grid_map.timestamp > 0


def test_filters_demo_delivers_topics_pictures_and_a_table(tmp_path):
    demo, mark = start_marked("--report", str(tmp_path))
    assert demo.wait(90) == 0, demo.text
    wait_until(lambda: not living(mark), "the end of the processes")
    assert {path.name for path in tmp_path.iterdir()} == {"elevation.png", "traversability.png"}
    for path in tmp_path.iterdir():
        assert path.read_bytes().startswith(PNG)
        assert path.stat().st_size > 50_000
    lines = [" ".join(line.split()) for line in demo.text.splitlines()]
    assert "cells 403 x 344 = 138632" in lines
    assert "layers 11" in lines
    for name in ["inpaint", "surface_normals", "traversability", "whole chain"]:
        assert any(re.fullmatch(rf"{name} \d+\.\d\d", line) for line in lines), name
    assert any(re.fullmatch(r"published to filtered \d+ ms", line) for line in lines)
    for topic in ["/grid_map", "/filtered_map", "/elevation_points", "/surface_normals"]:
        assert any(re.fullmatch(rf"{topic} [1-9]\d*", line) for line in lines), topic


def test_filters_demo_ignores_ros_arguments_and_runs_until_interrupted():
    with peer() as other:
        other.listen("/filtered_map", GridMapMessage)
        demo, mark = start_marked("--ros-args", "-r", "__node:=demo")
        first = from_message(other.expect("/filtered_map", 1))
        second = from_message(other.expect("/filtered_map", 2))
        assert first.timestamp < second.timestamp
        first.timestamp = second.timestamp
        assert_maps_equal(first, second)
        ends(demo, mark, 0)


def test_filters_demo_is_shown_in_the_browser():
    pytest.importorskip("rerun")
    demo, mark = start_marked("--view", "0")
    pattern = re.compile(r"shows messages in the browser at\n(http://127\.0\.0\.1:\d+)\n")
    wait_until(lambda: pattern.search(demo.text), "the address of the page")
    address = pattern.search(demo.text)[1]
    wait_until(lambda: "shows /filtered_map" in demo.text, "the topic")
    wait_until(lambda: "the first message is shown; see\n" in demo.text, "the first message")
    wait_until(lambda: f"see\n{address}\n" in demo.text, "the address near the end")
    with urlopen(address, timeout=30) as answer:
        assert b"<html" in answer.read()
    ends(demo, mark, 0)


def test_demos_take_the_viewer_that_is_installed(monkeypatch):
    installed = ["viser"]
    monkeypatch.setattr(launcher, "find_spec", lambda name: name in installed)
    assert launcher.viewer().endswith(".web_viewer")
    installed.append("rerun_cli")
    assert launcher.viewer().endswith(".rerun_viewer")
    # The web viewer reports the missing package.
    installed.clear()
    assert launcher.viewer().endswith(".web_viewer")


@pytest.mark.parametrize("count", [2, 5, "FilterChain("])
def test_interrupt_leaves_no_process_and_no_traceback(tmp_path, count):
    demo, mark = start_marked("--report", str(tmp_path))
    if isinstance(count, int):
        wait_until(lambda: len(pythons(mark)) >= count, f"{count} processes")
    else:
        wait_until(lambda: count in demo.text, "the filter chain")
    ends(demo, mark, 1)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("words", [["--reprot", "out"], ["out"], ["--report"]])
def test_unknown_arguments_end_the_filters_demo(words):
    demo = start_node(*FILTERS_DEMO, *words)
    assert demo.wait() == 2
    assert "usage: filters_demo" in demo.text


def test_killed_demo_leaves_no_process():
    demo, mark = start_marked()
    wait_until(lambda: len(living(mark)) == 4, "the processes of the demo")
    os.kill(demo.pid, signal.SIGKILL)
    wait_until(lambda: not living(mark), "the end of the processes")
    demo.wait()


def test_report_counts_only_valid_maps_and_chain_diagnostics(tmp_path):
    ours = DiagnosticStatus(name="grid_map_filters")
    battery = DiagnosticStatus(name="battery", values=[KeyValue(key="ms left", value="plenty")])
    strange = DiagnosticStatus(name=ours.name, values=[KeyValue(key="ms inpaint", value="few")])
    broken = to_message(GridMap((1.0, 1.0), 0.5, layers=["elevation"]))
    broken.info.resolution = 0.0
    with peer() as other:
        given = parameters("timeout:=3.0", f"output_directory:={tmp_path}")
        process = start_node(*REPORT, *given)
        for status in (battery, strange, ours, battery):
            other.publish("/diagnostics", DiagnosticArray(status=[status]), 10)
        other.publish("/filtered_map", broken)
        assert process.wait() == 1
    assert "Traceback" not in process.text
    assert "after 3 s too few messages on /grid_map, /elevation_points" in process.text
    assert "/filtered_map, /diagnostics" in process.text
    assert not list(tmp_path.iterdir())
    assert (
        "dropped a message of /filtered_map: info.resolution: expected a positive" in process.text
    )


def test_failing_node_ends_the_demo(tmp_path):
    with_bad_parameter = (
        "import sys; from grid_map_demos_py.launcher import filters_demo as demo; "
        "demo.nodes['grid_map_filters_py._executables.filter_chain'] = 'simple_demo.yaml'; "
        f"sys.exit(demo(['--report', {str(tmp_path)!r}]))"
    )
    demo = Process([sys.executable, "-c", with_bad_parameter])
    assert demo.wait(60) == 1
    assert "grid_map_filters_py._executables.filter_chain ended with exit code 1" in demo.text
    assert "filters: expected at least one filter, got none" in demo.text
