# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Launch files, read and started without ROS launch, which has no wheels.

Only what the demos need of the XML form is known; anything else is refused, so that a file that is
read here means the same to `ros2 launch`:

    <launch>
      <arg name="" default="" description=""/>
      <node pkg="" exec="" name="" output="screen" args="" if="">
        <param from=""/>
        <param name="" value=""/>
        <remap from="" to=""/>
      </node>
    </launch>

with `$(var name)` and `$(find-pkg-share package)` in values.
"""

import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

WORKSPACE = Path(__file__).parents[2]
LAUNCH_FILES = sorted((WORKSPACE / "grid_map_demos_py" / "launch").iterdir())

Substitute = Callable[[str], str]

ATTRIBUTES = {
    "launch": [set()],
    "arg": [{"name", "default", "description"}],
    "node": [{"pkg", "exec", "output"}],
    "param": [{"from"}, {"name", "value"}],
    "remap": [{"from", "to"}],
}
"""Which attributes an element must have; one of several sets."""

OPTIONAL = {"node": {"name", "args", "if"}}
CHILDREN = {"launch": {"arg", "node"}, "node": {"param", "remap"}}
TRUTH = {"true": True, "1": True, "false": False, "0": False}


class LaunchFileError(ValueError):
    """A launch file is wrong, or uses what is not known here."""


@dataclass(frozen=True)
class LaunchedNode:
    """A process that a launch file asks for, with all values filled in."""

    package: str
    executable: str
    name: str | None = None
    words: list[str] = field(default_factory=list)
    parameter_files: list[Path] = field(default_factory=list)
    parameters: Mapping[str, str] = field(default_factory=dict)
    remappings: Mapping[str, str] = field(default_factory=dict)

    @property
    def module(self) -> str:
        """The module behind the executable, which must be one of this workspace."""
        modules = entry_points(self.package)
        if self.executable not in modules:
            raise LaunchFileError(
                f"package {self.package!r} has no executable {self.executable!r}, "
                f"only {sorted(modules)}"
            )
        return modules[self.executable]

    @property
    def arguments(self) -> list[str]:
        """What follows the executable on the command line."""
        names = {"__node": self.name} if self.name else {}
        rules = [f"{old}:={new}" for old, new in {**names, **self.remappings}.items()]
        values = [f"{name}:={value}" for name, value in self.parameters.items()]
        ros = [("--params-file", str(path)) for path in self.parameter_files]
        ros += [("-p", value) for value in values] + [("-r", rule) for rule in rules]
        return [*self.words, "--ros-args", *(word for pair in ros for word in pair)]


def entry_points(package: str) -> dict[str, str]:
    """Return the modules of the executables of a package of this workspace, by name."""
    setup = WORKSPACE / package / "setup.py"
    if not setup.is_file():
        raise LaunchFileError(f"there is no package {package!r} here")
    return dict(re.findall(r'"(\w+) = ([\w.]+):\w+"', setup.read_text()))


def read_launch_file(
    path: Path, find_share: Callable[[str], str], **arguments: str
) -> list[LaunchedNode]:
    """Return the nodes that a launch file starts.

    Args:
        path: the file.
        find_share: returns the share folder of a package.
        arguments: what would be given as `name:=value`.

    Raises:
        LaunchFileError: the file holds something that is not known here.
    """
    root = ElementTree.parse(path).getroot()
    if root.tag != "launch":
        raise LaunchFileError(f"expected <launch>, found <{root.tag}>")
    _check(root)
    values: dict[str, str] = {}

    def substitute(text: str) -> str:
        return _substitute(text, values, find_share)

    for arg in root.iter("arg"):
        name, default = arg.attrib["name"], substitute(arg.attrib["default"])
        values[name] = arguments.get(name, default)
    unknown = arguments.keys() - values.keys()
    if unknown:
        raise LaunchFileError(f"arguments that are not declared: {sorted(unknown)}")
    # All are read, so that what an argument leaves out is checked as well.
    nodes = [
        (_read_node(node, substitute), _is_wanted(node, substitute)) for node in root.iter("node")
    ]
    return [node for node, is_wanted in nodes if is_wanted]


def _check(element: Element) -> None:
    """Refuse attributes, children and text that are not known."""
    found, optional = {*element.attrib}, OPTIONAL.get(element.tag, set())
    if found - optional not in ATTRIBUTES[element.tag]:
        raise LaunchFileError(
            f"<{element.tag}>: expected the attributes {ATTRIBUTES[element.tag]}, found {found}"
        )
    if element.get("output", "screen") != "screen":
        raise LaunchFileError(f"output: expected 'screen', found {element.attrib['output']!r}")
    if any(text and text.strip() for text in (element.text, *(child.tail for child in element))):
        raise LaunchFileError(f"<{element.tag}>: expected no text")
    for child in element:
        if child.tag not in CHILDREN.get(element.tag, ()):
            raise LaunchFileError(f"<{child.tag}> in <{element.tag}> is not supported")
        _check(child)


def _substitute(text: str, values: Mapping[str, str], find_share: Callable[[str], str]) -> str:
    def replacement(match: re.Match[str]) -> str:
        kind, name = match["kind"], match["name"]
        if kind == "find-pkg-share":
            return find_share(name)
        if kind == "var" and name in values:
            return values[name]
        raise LaunchFileError(f"{match[0]}: no such substitution, or argument, is known")

    result = re.sub(r"\$\((?P<kind>[^\s()]+) (?P<name>[^\s()]+)\)", replacement, text)
    if "$" in result:
        raise LaunchFileError(f"{text!r}: expected $(var name) or $(find-pkg-share package)")
    return result


def _is_wanted(node: Element, substitute: Substitute) -> bool:
    value = substitute(node.get("if", "true"))
    if value.lower() not in TRUTH:
        raise LaunchFileError(f"if: expected true or false, found {value!r}")
    return TRUTH[value.lower()]


def _read_node(node: Element, substitute: Substitute) -> LaunchedNode:
    parameters = [
        {key: substitute(value) for key, value in param.attrib.items()}
        for param in node.iter("param")
    ]
    return LaunchedNode(
        package=node.attrib["pkg"],
        executable=node.attrib["exec"],
        name=node.get("name"),
        words=shlex.split(substitute(node.get("args", ""))),
        parameter_files=[Path(param["from"]) for param in parameters if "from" in param],
        parameters={param["name"]: param["value"] for param in parameters if "name" in param},
        remappings={
            substitute(remap.attrib["from"]): substitute(remap.attrib["to"])
            for remap in node.iter("remap")
        },
    )
