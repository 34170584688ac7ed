# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Launch files, without starting anything: what they say is understood, what they name is there."""

import re

import pytest
import yaml
from launch_files import (
    LAUNCH_FILES,
    WORKSPACE,
    LaunchedNode,
    LaunchFileError,
    entry_points,
    read_launch_file,
)

DEMOS = "grid_map_demos_py"
RVIZ = ("rviz2", "rviz2")
ENDING = "_launch.xml"

each_file = pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.stem)


def source(package: str) -> str:
    """Return what is installed as the share folder of a package of this workspace."""
    return str(WORKSPACE / package)


def own_nodes(path) -> list[LaunchedNode]:
    return read_launch_file(path, source, rviz="false")


def node_name(node: LaunchedNode) -> str:
    """Return the name by which parameter files know a node."""
    if node.name:
        return node.name
    module = (WORKSPACE / node.package).joinpath(*node.module.split(".")).with_suffix(".py")
    pattern = r'(?:super\(\)\.__init__\(|NODE_NAME = )\s*"(\w+)"'
    return re.search(pattern, module.read_text())[1]


def test_launch_files_are_named_after_demos_and_installed():
    assert LAUNCH_FILES
    setup = (WORKSPACE / DEMOS / "setup.py").read_text()
    assert 'glob("launch/*")' in setup
    for path in LAUNCH_FILES:
        assert path.name.endswith(ENDING)
        assert f'"{path.name.removesuffix(ENDING)} = ' in setup


def test_every_demo_has_a_launch_file_but_the_one_that_ends_by_itself():
    demos = {name for name in entry_points(DEMOS) if name.endswith("_demo")}
    assert {path.name.removesuffix(ENDING) for path in LAUNCH_FILES} == demos - {
        "grid_map_to_image_demo"
    }


@each_file
def test_every_node_is_an_executable_of_this_workspace_that_shows_what_it_says(path):
    nodes = own_nodes(path)
    assert all(node.module for node in nodes)
    assert "grid_map_visualization" in {node.executable for node in nodes}


@each_file
def test_every_parameter_file_has_a_section_for_the_node_that_gets_it(path):
    for node in own_nodes(path):
        for file in node.parameter_files:
            section = yaml.safe_load(file.read_text())[node_name(node)]
            assert [*section] == ["ros__parameters"]


@each_file
def test_rviz_comes_with_the_configuration_of_the_demo_unless_it_is_not_wanted(path):
    demo = path.name.removesuffix(ENDING)
    configuration = WORKSPACE / DEMOS / "rviz" / f"{demo}.rviz"
    assert configuration.is_file()
    (rviz,) = (node for node in read_launch_file(path, source) if node.package == "rviz2")
    assert (rviz.package, rviz.executable) == RVIZ
    assert rviz.words == ["-d", str(configuration)]
    assert len(own_nodes(path)) == len(read_launch_file(path, source)) - 1


# --- the reader -----------------------------------------------------------------------------------


def read(folder, content: str, **arguments: str) -> list[LaunchedNode]:
    path = folder / "some_launch.xml"
    path.write_text(f"<launch>{content}</launch>")
    return read_launch_file(path, lambda package: f"/share/{package}", **arguments)


def test_a_node_is_read_with_everything_that_it_may_have(tmp_path):
    (node,) = read(
        tmp_path,
        """
        <!-- a comment -->
        <arg name="rate" default="5.0" description="how often"/>
        <arg name="file" default="$(find-pkg-share q)/a" description="what to read"/>
        <node pkg="p" exec="e" name="n" output="screen" args="-d $(var file) -v">
          <param name="rate" value="$(var rate)"/>
          <param from="$(find-pkg-share q)/config/a.yaml"/>
          <remap from="in" to="/out"/>
        </node>
        """,
        rate="2.0",
    )
    assert (node.package, node.executable) == ("p", "e")
    # As ROS launch does it, values take precedence over files.
    assert node.arguments == [
        *("-d", "/share/q/a", "-v", "--ros-args", "--params-file", "/share/q/config/a.yaml"),
        *("-p", "rate:=2.0", "-r", "__node:=n", "-r", "in:=/out"),
    ]


@pytest.mark.parametrize(("value", "count"), [("true", 1), ("1", 1), ("False", 0), ("0", 0)])
def test_a_condition_decides_whether_a_node_starts(tmp_path, value, count):
    content = """<arg name="a" default="true" description="whether"/>
                 <node pkg="p" exec="e" output="screen" if="$(var a)"/>"""
    assert len(read(tmp_path, content, a=value)) == count


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<include file='a'/>", "<include> in <launch> is not supported"),
        ("<group><node pkg='p' exec='e' output='screen'/></group>", "<group> in <launch>"),
        ("<node pkg='p' exec='e'/>", "<node>: expected the attributes"),
        ("<node pkg='p' exec='e' output='screen' namespace='n'/>", "<node>: expected"),
        ("<node pkg='p' exec='e' output='log'/>", "output: expected 'screen', found 'log'"),
        ("<node pkg='p' exec='e' output='screen'>text</node>", "<node>: expected no text"),
        ("<node pkg='p' exec='e' output='screen'><env/></node>", "<env> in <node> is not"),
        ("<node pkg='p' exec='e' output='screen'><param/></node>", "<param>: expected"),
        (
            "<node pkg='p' exec='e' output='screen'><param from='a' name='b'/></node>",
            "<param>: expected",
        ),
        ("<arg name='a' default='b'/>", "<arg>: expected"),
        ("<node pkg='p' exec='e' output='screen' if='maybe'/>", "if: expected true or false"),
        ("<node pkg='p' exec='e' output='screen' args='$(var a)'/>", r"\$\(var a\): no such"),
        ("<node pkg='p' exec='e' output='screen' args='$(env A)'/>", r"\$\(env A\): no such"),
        ("<node pkg='p' exec='e' output='screen' args='$HOME'/>", r"'\$HOME': expected \$\(var"),
    ],
)
def test_what_is_not_known_is_refused(tmp_path, content, message):
    with pytest.raises(LaunchFileError, match=message):
        read(tmp_path, content)


def test_arguments_that_are_not_declared_are_refused(tmp_path):
    with pytest.raises(LaunchFileError, match=r"not declared: \['b'\]"):
        read(tmp_path, "<arg name='a' default='1' description='x'/>", b="2")


def test_a_file_that_is_no_launch_file_is_refused(tmp_path):
    path = tmp_path / "some_launch.xml"
    path.write_text("<robot/>")
    with pytest.raises(LaunchFileError, match="expected <launch>, found <robot>"):
        read_launch_file(path, source)


@pytest.mark.parametrize(
    ("package", "message"), [("p", "no package 'p'"), (DEMOS, "no executable")]
)
def test_an_executable_that_does_not_exist_is_refused(package, message):
    with pytest.raises(LaunchFileError, match=message):
        print(LaunchedNode(package, "simple_dmeo").module)
