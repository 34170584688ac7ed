# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Launch files name executables, parameter files and RViz configurations that exist."""

import re

import pytest
import yaml
from launch_files import LAUNCH_FILES, WORKSPACE, LaunchedNode, entry_points, read_launch_file

DEMOS = "grid_map_demos_py"
ENDING = "_launch.xml"

each_file = pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.stem)


def own_nodes(path) -> list[LaunchedNode]:
    return [node for node in read_launch_file(path) if node.package != "rviz2"]


def node_name(node: LaunchedNode) -> str:
    """Return the name by which parameter files know a node."""
    if node.name:
        return node.name
    module = (WORKSPACE / node.package).joinpath(*node.module.split(".")).with_suffix(".py")
    pattern = r'(?:super\(\)\.__init__\(|NODE_NAME = )\s*"(\w+)"'
    return re.search(pattern, module.read_text())[1]


def test_every_demo_has_an_installed_launch_file():
    demos = {name for name in entry_points(DEMOS) if name.endswith("_demo")}
    # This demo ends by itself.
    demos.remove("grid_map_to_image_demo")
    assert {path.name for path in LAUNCH_FILES} == {demo + ENDING for demo in demos}
    assert 'glob("launch/*")' in (WORKSPACE / DEMOS / "setup.py").read_text()


@each_file
def test_launched_executables_exist_and_include_the_visualization(path):
    nodes = own_nodes(path)
    assert all(node.module for node in nodes)
    assert "grid_map_visualization" in {node.executable for node in nodes}
    assert all(node.condition is None for node in nodes)


@each_file
def test_parameter_files_have_a_section_for_their_node(path):
    for node in own_nodes(path):
        for file in node.parameter_files:
            section = yaml.safe_load(file.read_text())[node_name(node)]
            assert [*section] == ["ros__parameters"]


@each_file
def test_rviz_shows_the_configuration_of_the_demo_if_wanted(path):
    demo = path.name.removesuffix(ENDING)
    configuration = WORKSPACE / DEMOS / "rviz" / f"{demo}.rviz"
    assert configuration.is_file()
    (rviz,) = (node for node in read_launch_file(path) if node.package == "rviz2")
    assert (rviz.executable, rviz.condition) == ("rviz2", "$(var rviz)")
    assert rviz.arguments == ["-d", str(configuration)]
