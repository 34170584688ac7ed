# SPDX-License-Identifier: BSD-3-Clause
"""Invalid parameters, a port in use or a missing package end every node with one message."""

import socket
from collections.abc import Iterator

import pytest
import yaml

from grid_map_ros_py.nodes._poses import has_tf
from grid_map_ros_py.testing import refusals

PROGRAMS = "grid_map_visualization_py._executables"
WEB_VIEWER = f"{PROGRAMS}.web_viewer:WebViewerNode.main"
RERUN_VIEWER = f"{PROGRAMS}.rerun_viewer:RerunViewerNode.main"

OUTPUTS = {
    "grid_map_visualizations": ["grid"],
    "grid": {"type": "occupancy_grid", "params": {"layer": "elevation", "data_max": 1}},
}

REFUSED: list[tuple[dict[str, object], list[str]]] = [
    (
        {"grid": {"type": "occupancy_grid", "params": {"layer": "a", "data_mix": 1}}},
        ["visualization 'grid'", "'occupancy_grid'", "'data_mix'", "data_min"],
    ),
    ({"activity_check_rate": 0}, ["activity_check_rate", "positive", "0.0"]),
    (
        {"grid_map_visualizations": ["grid", "grid"]},
        ["'grid_map_visualizations'", "every name once", "['grid', 'grid']"],
    ),
    (
        {"grid_map_visualizations": ["no topic"], "no topic": {"type": "map_region"}},
        ["'grid_map_visualizations'", "topic", "'no topic'"],
    ),
    ({"grid_map_topic": "{terrain}"}, ["'grid_map_topic'", "topic", "'{terrain}'"]),
]
"""Parameters of `grid_map_visualization`, and parts of the message."""


def test_misconfigured_visualizations_end_the_node_with_one_message(tmp_path):
    starts = []
    for number, (wrong, _) in enumerate(REFUSED):
        path = tmp_path / f"{number}.yaml"
        parameters = {"grid_map_visualization": {"ros__parameters": OUTPUTS | wrong}}
        path.write_text(yaml.safe_dump(parameters))
        main = f"{PROGRAMS}.grid_map_visualization:GridMapVisualizationNode.main"
        starts.append((main, ["--ros-args", "--params-file", str(path)]))
    for message, (_, words) in zip(refusals(starts), REFUSED, strict=True):
        assert [word for word in words if word not in message] == []


VIEWER = {
    "port:=65536": "parameter 'port': expected a number from 0 to 65535",
    "max_drawn_cells:=3": "parameter 'max_drawn_cells': expected 0 (never thin out) or",
    "color_map:=virdis": "did you mean viridis",
}
"""Parameters that both viewers have, as `name:=value`, and a part of the message."""


@pytest.fixture
def taken() -> Iterator[int]:
    """A port on which another process listens."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener.getsockname()[1]


def refuses(main: str, complaints: dict[str, str], taken: int) -> None:
    """Assert that a viewer names what is wrong with parameters, and a port in use."""
    served = f"the page cannot be served at 127.0.0.1:{taken}: [Errno 98]"
    complaints = {**VIEWER, f"port:={taken}": served, **complaints}
    starts = [(main, ["--ros-args", "-p", parameter]) for parameter in complaints]
    for message, complaint in zip(refusals(starts), complaints.values(), strict=True):
        assert complaint in message


def test_web_viewer_that_cannot_start_ends_with_one_message(taken):
    complaints = {
        "host:=192.0.2.1": "the page cannot be served at 192.0.2.1:8080: ",
        "update_rate:=0": "parameter 'update_rate': expected a positive",
        "grid_map_topic:='no topic'": "parameter 'grid_map_topic': expected the name",
    }
    if not has_tf():
        complaints["robot_frame:=base"] = "robot_frame needs the package 'tf2_ros'"
    refuses(WEB_VIEWER, complaints, taken)


@pytest.mark.needs("rerun")
def test_rerun_viewer_that_cannot_start_ends_with_one_message(taken):
    complaints = {
        "max_rate:=0": "parameter 'max_rate': expected a positive",
        "exaggeration:=-1": "parameter 'exaggeration': expected a positive",
        "topics:=['no topic']": "parameter 'topics': expected the name",
    }
    refuses(RERUN_VIEWER, complaints, taken)


def test_viewers_name_the_package_that_is_missing():
    starts = [(main, []) for main in (WEB_VIEWER, RERUN_VIEWER)]
    web_viewer, rerun_viewer = refusals(starts, missing=["viser", "rerun_cli"])
    missing = "_viewer needs the package '{}', which is not installed: "
    assert "web" + missing.format("viser") + "pip install viser" in web_viewer
    assert "rerun" + missing.format("rerun_cli") + "pip install" in rerun_viewer
    assert "or use web_viewer" in rerun_viewer
