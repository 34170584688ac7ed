# SPDX-License-Identifier: BSD-3-Clause
"""Given parameters that a node does not take: misspelt names, and files for other nodes."""

import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any

from rclpy.node import Node

from grid_map_core_py._parameters import node_sections
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import load_yaml


def unmatched_files(node: Node, arguments: Sequence[str]) -> str:
    """Return a text on parameter files that have no section for a node; empty if there are none."""
    name, texts = node.get_fully_qualified_name(), []
    for file, sections in _files(arguments):
        if not any(_matches(section, name) for section in sections):
            known = ", ".join(sections) or "none"
            texts.append(f"no section of {file} matches {name}; the file has {known}")
    return "; ".join(texts)


def unknown_parameters(node: Node, arguments: Sequence[str]) -> str:
    """Return a text on parameters that a node was given and has not declared; empty without them.

    A section for several nodes, such as `/**`, may have parameters of the others.
    """
    shared = {
        f"{key}."
        for _, sections in _files(arguments)
        for section, parameters in sections.items()
        if "*" in section
        for key in parameters
    }
    declared = {name: name.partition(".")[0] for name in node.get_parameters_by_prefix("")}
    texts = {}
    for name in sorted(node._parameter_overrides):
        is_shared = any(f"{name}.".startswith(prefix) for prefix in shared)
        if name in declared or is_shared or name.startswith("qos_overrides."):
            continue
        root = name.partition(".")[0]
        # Of a whole tree that the node does not read, one line is enough.
        wrong, known = (name, declared) if root in declared.values() else (root, declared.values())
        close = difflib.get_close_matches(wrong, known, n=1)
        texts[wrong] = f"{wrong!r} (did you mean {close[0]!r}?)" if close else repr(wrong)
    return f"unknown parameters, not used: {', '.join(texts.values())}" if texts else ""


def _files(arguments: Sequence[str]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the parameter files of a command line, each with its sections."""
    for option, file in pairwise(arguments):
        if option == "--params-file":
            # ROS has read the file before, but its parser differs in details.
            with suppress(GridMapError):
                yield file, dict(node_sections(load_yaml(file) or {}))


def _matches(section: str, name: str) -> bool:
    """Return whether a section, in which `*` is one name and `**` any number, is for a node."""
    parts = {"/**": "(/[^/]+)*", "/*": "/[^/]+"}
    pattern = re.sub(r"/\*\*?|[^/]+|/", lambda m: parts.get(m[0], re.escape(m[0])), section)
    return re.fullmatch(pattern, name) is not None
