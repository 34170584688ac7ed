# SPDX-License-Identifier: BSD-3-Clause
"""Launch files start installed nodes; RViz and Foxglove show their topics in standard displays."""

import json
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import pytest
import yaml
from ament_index_python.packages import get_package_share_directory
from demos import LAUNCH_FILES, MESSAGES, PACKAGE, launched_nodes, rviz, rviz_displays
from geometry_msgs.msg import PolygonStamped
from nav_msgs.msg import Path as PathMessage
from sensor_msgs.msg import Image, PointCloud2
from visualization_msgs.msg import MarkerArray

from grid_map_visualization_py import create

OWN_TOPICS = {
    "image_to_gridmap_demo": {"/image": Image},
    "iterators_demo": {"/polygon": PolygonStamped},
    "path_planner_demo": {"/plan": PathMessage},
    "planar_regions_demo": {"/planar_regions": MarkerArray},
    "sdf_demo": {
        f"/grid_map_sdf_demo/signed_distance_field/{name}": PointCloud2
        for name in ("full_sdf", "free_space", "occupied_space")
    },
}
"""Message types by topic, for topics that RViz shows besides the visualizations of a demo."""

LAYOUTS = sorted(path.stem for path in (PACKAGE / "foxglove").iterdir())
"""Demos with a Foxglove layout."""

STOCK = {
    *MESSAGES,
    "",
    *(f"rviz_common/{name}" for name in ("Displays", "Views")),
    *(
        f"rviz_default_plugins/{name}"
        for name in ("FocusCamera", "Grid", "Interact", "Measure", "MoveCamera", "Orbit", "SetGoal")
    ),
}
PANELS = {"3D", "DiagnosticSummary", "Image"}

each_demo = pytest.mark.parametrize("demo", LAUNCH_FILES)


def own_nodes(demo: str) -> dict[str, Element]:
    """Return the nodes of a launch file without RViz, by executable."""
    return {node.get("exec"): node for node in launched_nodes(demo) if node.get("pkg") != "rviz2"}


def visualized(demo: str) -> dict[str, type]:
    """Return the message types of the visualizations, by topic."""
    (file,) = own_nodes(demo)["grid_map_visualization"].iter("param")
    found = {}
    for section in yaml.safe_load(Path(file.get("from")).read_text()).values():
        parameters = section["ros__parameters"]
        for name in parameters.get("grid_map_visualizations", ()):
            found[f"/{name}"] = create(name, parameters[name]).message_type
    return found


def classes(node: Any) -> Iterator[str]:
    """Yield the classes of all items in an RViz configuration."""
    if isinstance(node, dict):
        if "Class" in node:
            yield node["Class"]
        node = list(node.values())
    if isinstance(node, list):
        for child in node:
            yield from classes(child)


def leaves(layout: Any) -> Iterator[str]:
    """Yield the panels of a Foxglove layout."""
    if isinstance(layout, str):
        yield layout
    else:
        yield from leaves(layout["first"])
        yield from leaves(layout["second"])


def test_every_demo_has_a_launch_file_and_displays():
    entries = {entry.name for entry in entry_points(group="console_scripts")}
    # The first demo ends by itself; the second creates its map before the nodes start.
    without = {"grid_map_to_image_demo", "large_map_demo"}
    assert {*LAUNCH_FILES} == {e for e in entries if e.endswith("_demo")} - without
    share = Path(get_package_share_directory(PACKAGE.name))
    for folder in ("foxglove", "launch", "rviz"):
        names = {path.name for path in (PACKAGE / folder).iterdir()}
        assert {path.name for path in (share / folder).iterdir()} == names
    assert {path.stem for path in (PACKAGE / "rviz").iterdir()} == {*LAUNCH_FILES}
    assert {*LAYOUTS} <= {*LAUNCH_FILES}


@each_demo
def test_parameter_files_have_a_section_for_their_node(demo):
    nodes = own_nodes(demo)
    assert "grid_map_visualization" in nodes
    for node in nodes.values():
        assert (node.get("output"), node.get("if")) == ("screen", None)
        assert (node.get("respawn"), node.get("respawn_delay")) == ("true", "2.0")
        for file in (param.get("from") for param in node if "from" in param.attrib):
            section = yaml.safe_load(Path(file).read_text())[node.get("name")]
            assert [*section] == ["ros__parameters"]


@each_demo
def test_rviz_comes_first_with_the_configuration_of_the_demo(demo):
    # Where RViz is not installed, the launch ends there and must not leave nodes behind.
    rviz, *others = launched_nodes(demo)
    assert (rviz.get("pkg"), rviz.get("exec"), rviz.get("if")) == ("rviz2", "rviz2", "$(var rviz)")
    assert rviz.get("args") == f"-d {PACKAGE}/rviz/{demo}.rviz"
    assert "rviz2" not in {node.get("pkg") for node in others}


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
    robots = "elevation_mapping_demo", "path_planner_demo", "planar_regions_demo"
    frame = "odom" if demo in robots else "map"
    assert rviz(demo)["Visualization Manager"]["Global Options"]["Fixed Frame"] == frame
    for display in displays.values():
        # The last map arrives, even if nothing new is published.
        assert display["Topic"]["Durability Policy"] == "Transient Local"
        assert display["Topic"]["Reliability Policy"] == "Reliable"


@pytest.mark.parametrize("demo", LAYOUTS)
def test_foxglove_shows_every_output_of_the_demo(demo):
    layout = json.loads((PACKAGE / "foxglove" / f"{demo}.json").read_text())
    assert {*leaves(layout["layout"])} == {*layout["configById"]}
    topics = set()
    for name, panel in layout["configById"].items():
        assert name.partition("!")[0] in PANELS
        topics |= {*panel.get("topics", ())}
        topics |= {panel.get("imageMode", {}).get("imageTopic"), panel.get("topicToRender")}
    diagnostics = set() if demo == "simple_demo" else {"/diagnostics"}
    assert topics - {None} == {*visualized(demo)} | diagnostics
