# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Configurations of RViz and Foxglove: they show the topics of the demos with standard displays."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from geometry_msgs.msg import PolygonStamped
from launch_files import MESSAGES, rviz_displays
from sensor_msgs.msg import Image, PointCloud2

from grid_map_visualization_py import create

PACKAGE = Path(__file__).parent.parent
DEMOS = sorted(path.name.removesuffix("_launch.xml") for path in (PACKAGE / "launch").iterdir())
"""Demos with a launch file; each has a configuration of RViz of its name."""

OWN_TOPICS = {
    "image_to_gridmap_demo": {"/image": Image},
    "iterators_demo": {"/polygon": PolygonStamped},
    "sdf_demo": {
        f"/grid_map_sdf_demo/signed_distance_field/{name}": PointCloud2
        for name in ("full_sdf", "free_space", "occupied_space")
    },
}
"""Types of message by topic that a demo publishes beside its visualizations for RViz to show."""

LAYOUTS = sorted(path.stem for path in (PACKAGE / "foxglove").iterdir())
"""Demos with a layout of Foxglove."""

STOCK = {
    *MESSAGES,
    "",
    "rviz_common/Displays",
    "rviz_common/Views",
    "rviz_default_plugins/FocusCamera",
    "rviz_default_plugins/Grid",
    "rviz_default_plugins/Interact",
    "rviz_default_plugins/Measure",
    "rviz_default_plugins/MoveCamera",
    "rviz_default_plugins/Orbit",
}
PANELS = {"3D", "DiagnosticSummary", "Image"}
each_demo = pytest.mark.parametrize("demo", DEMOS)


def visualized(demo: str) -> dict[str, type]:
    """Return the type of message by topic of the visualizations."""
    file = "filters_demo_visualization" if demo == "filters_demo" else demo
    path = PACKAGE / "config" / f"{file}.yaml"
    found = {}
    for section in yaml.safe_load(path.read_text()).values():
        parameters = section["ros__parameters"]
        for name in parameters.get("grid_map_visualizations", ()):
            found[f"/{name}"] = create(name, parameters[name]).message_type
    return found


def rviz(demo: str) -> Any:
    return yaml.safe_load((PACKAGE / "rviz" / f"{demo}.rviz").read_text())


def foxglove(demo: str) -> Any:
    return json.loads((PACKAGE / "foxglove" / f"{demo}.json").read_text())


def classes(node: Any) -> Iterator[str]:
    """Yield the class of everything in a configuration of RViz."""
    if isinstance(node, dict):
        if "Class" in node:
            yield node["Class"]
        node = list(node.values())
    if isinstance(node, list):
        for child in node:
            yield from classes(child)


def leaves(layout: Any) -> Iterator[str]:
    """Yield the panels that a layout of Foxglove places."""
    if isinstance(layout, str):
        yield layout
    else:
        yield from leaves(layout["first"])
        yield from leaves(layout["second"])


def test_every_configuration_belongs_to_a_demo_that_is_installed():
    setup = (PACKAGE / "setup.py").read_text()
    assert {path.stem for path in (PACKAGE / "rviz").iterdir()} == {*DEMOS}
    assert {*LAYOUTS} <= {*DEMOS}
    for folder in ("rviz", "foxglove"):
        assert f'glob("{folder}/*")' in setup
    for demo in DEMOS:
        assert f'"{demo} = ' in setup


@each_demo
def test_rviz_needs_no_plugins(demo):
    found = {*classes(rviz(demo))}
    assert found <= STOCK
    assert len(found) > 5


@each_demo
def test_rviz_displays_match_the_types_of_all_outputs(demo):
    displays = rviz_displays(demo)
    shown = {topic: MESSAGES[display["Class"]] for topic, display in displays.items()}
    assert shown == visualized(demo) | OWN_TOPICS.get(demo, {})
    manager = rviz(demo)["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == "map"
    for display in displays.values():
        # The last map arrives, even if nothing new is published.
        assert display["Topic"]["Durability Policy"] == "Transient Local"
        assert display["Topic"]["Reliability Policy"] == "Reliable"


@pytest.mark.parametrize("demo", LAYOUTS)
def test_foxglove_shows_every_output_of_the_demo(demo):
    layout = foxglove(demo)
    assert {*leaves(layout["layout"])} == {*layout["configById"]}
    topics = set()
    for name, panel in layout["configById"].items():
        assert name.partition("!")[0] in PANELS
        topics |= {*panel.get("topics", ())}
        topics |= {panel.get("imageMode", {}).get("imageTopic"), panel.get("topicToRender")}
    diagnostics = {"/diagnostics"} if demo == "filters_demo" else set()
    assert topics - {None} == {*visualized(demo)} | diagnostics
