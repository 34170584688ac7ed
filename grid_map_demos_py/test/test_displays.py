# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Configurations of RViz and Foxglove: they show what the demos publish, with stock displays."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from grid_map_visualization_py import create

PACKAGE = Path(__file__).parent.parent
VISUALIZATIONS = {
    "simple_demo": "simple_demo.yaml",
    "filters_demo": "filters_demo_visualization.yaml",
}
"""Parameter files by demo; each has a configuration of its name."""

SHOWN_BY = {
    "GridCells": "rviz_default_plugins/GridCells",
    "Image": "rviz_default_plugins/Image",
    "Marker": "rviz_default_plugins/Marker",
    "OccupancyGrid": "rviz_default_plugins/Map",
    "PointCloud2": "rviz_default_plugins/PointCloud2",
}
"""Displays that every installation of RViz has, by type of message."""

STOCK = {
    *SHOWN_BY.values(),
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
each_demo = pytest.mark.parametrize("demo", VISUALIZATIONS)


def published(demo: str) -> dict[str, str]:
    """Return the type of message by topic."""
    path = PACKAGE / "config" / VISUALIZATIONS[demo]
    parameters = yaml.safe_load(path.read_text())["grid_map_visualization"]["ros__parameters"]
    names = parameters["grid_map_visualizations"]
    return {f"/{name}": create(name, parameters[name]).message_type.__name__ for name in names}


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
    for folder, ending in (("rviz", "rviz"), ("foxglove", "json")):
        assert {path.name for path in (PACKAGE / folder).iterdir()} == {
            f"{demo}.{ending}" for demo in VISUALIZATIONS
        }
        assert f'glob("{folder}/*")' in setup
    for demo in VISUALIZATIONS:
        assert f'"{demo} = ' in setup


@each_demo
def test_rviz_needs_no_plugins(demo):
    found = {*classes(rviz(demo))}
    assert found <= STOCK
    assert len(found) > 5


@each_demo
def test_rviz_shows_every_output_of_the_demo_by_the_display_of_its_type(demo):
    manager = rviz(demo)["Visualization Manager"]
    displays = {d["Topic"]["Value"]: d for d in manager["Displays"] if "Topic" in d}
    shown = {topic: display["Class"] for topic, display in displays.items()}
    assert shown == {topic: SHOWN_BY[kind] for topic, kind in published(demo).items()}
    assert manager["Global Options"]["Fixed Frame"] == "map"
    for display in displays.values():
        # The last map arrives, even if nothing new is published.
        assert display["Topic"]["Durability Policy"] == "Transient Local"
        assert display["Topic"]["Reliability Policy"] == "Reliable"


@each_demo
def test_foxglove_shows_every_output_of_the_demo(demo):
    layout = foxglove(demo)
    assert {*leaves(layout["layout"])} == {*layout["configById"]}
    topics = set()
    for name, panel in layout["configById"].items():
        assert name.partition("!")[0] in PANELS
        topics |= {*panel.get("topics", ())}
        topics |= {panel.get("imageMode", {}).get("imageTopic"), panel.get("topicToRender")}
    diagnostics = {"/diagnostics"} if demo == "filters_demo" else set()
    assert topics - {None} == {*published(demo)} | diagnostics
