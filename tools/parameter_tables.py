# SPDX-License-Identifier: BSD-3-Clause
"""Write the parameter tables of the documentation from the code.

    python3 tools/parameter_tables.py [--check] [PAGE ...]

Replaces the text between `<!-- parameters: NAME -->` and `<!-- end -->` on the pages, by default on
all pages in `docs/`. NAME is one of these:

    an executable       that runs its node with `grid_map_ros_py.nodes.run`: the node is created,
                        and all parameters that it reads with `grid_map_ros_py.nodes` are listed,
                        except for the limits that every node has.
    a filter            such as `gridMapFilters/SlopeFilter`: the fields of the class are listed,
                        with their descriptions under `Attributes:` in the docstring.
    a visualization or sensor model, such as `surface` or `laser`: as for a filter.

With `--check`, nothing is written; the exit code is 1 if a table is outdated.
"""

import argparse
import contextlib
import dataclasses
import io
import json
import os
import re
import sys
import typing
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal
from unittest.mock import patch

import rclpy
from rclpy.node import Node

from grid_map_core_py._parameters import descriptions
from grid_map_core_py.errors import GridMapError
from grid_map_filters_py._registry import BUILT_IN as FILTERS
from grid_map_ros_py import nodes
from grid_map_ros_py._elevation_mapping.sources import MODELS
from grid_map_ros_py.nodes import _parameters as parameters, _spin
from grid_map_visualization_py._registry import BUILT_IN as VISUALIZATIONS

ROOT = Path(__file__).resolve().parents[1]

BAG = ROOT / "grid_map_ros_py" / "test" / "data" / "cpp_move_mcap"

GIVEN: dict[str, dict[str, object]] = {
    "elevation_mapping": {"input_sources.NAME.topic": "/points", "pose_source": "topic"},
    "filter_chain": {"filters.filter1.name": "a", "filters.filter1.type": "BufferNormalizer"},
    "grid_map_loader": {"file_path": str(BAG), "bag_topic": ""},
    "grid_map_saver": {"file_path": "/tmp/a_bag_that_is_not_written"},
    "grid_map_window": {"source": "a_store_that_is_not_there.zarr"},
    "grid_map_visualization": {"grid_map_visualizations": ["NAME"], "NAME.type": "map_region"},
    "rerun_viewer": {"port": 0},
    "web_viewer": {"port": 0},
}
"""Parameters without which these nodes cannot be created; the tables show the other defaults."""

LIMITS = {"max_cells", "max_bytes", "max_ratio"}
"""Parameters of every node, which `docs/ros.md` explains."""

TABLE = re.compile(r"(<!-- parameters: (\S+) -->\n).*?(<!-- end -->)", re.DOTALL)


@dataclass(frozen=True)
class Row:
    """A parameter; `kind` and `default` are formatted for the table."""

    name: str
    kind: str
    default: str
    meaning: str

    def __str__(self) -> str:
        cells = f"`{self.name}`", self.kind, self.default, self.meaning.replace("|", r"\|")
        return "|".join(("", *(f" {cell} " if cell else " " for cell in cells), ""))


# --- filters and visualizations -------------------------------------------------------------------


def rows_of_class(cls: type) -> list[Row]:
    """Return one row per parameter of a filter or visualization."""
    hints, meanings, rows = typing.get_type_hints(cls), descriptions(cls), []
    # Optional parameters of a base class come last.
    inherited = {
        field.name
        for base in filter(dataclasses.is_dataclass, cls.__mro__[1:])
        for field in dataclasses.fields(base)
        if field.default is not dataclasses.MISSING
    }
    fields = [field for field in dataclasses.fields(cls) if field.init]
    for field in sorted(fields, key=lambda field: field.name in inherited):
        name, has_default = field.name, field.default not in (dataclasses.MISSING, None)
        default = written(name, field.default) if has_default else ""
        # Docstrings quote values; pages format them as code.
        meaning = re.sub(r'"([\w/]+)"', r"`\1`", meanings.get(name, ""))
        rows.append(Row(name, kind(hints[name]), default, meaning))
    return rows


# --- nodes ----------------------------------------------------------------------------------------


@cache
def rows_of_node(executable: str) -> list[Row]:
    """Return one row per parameter of a node, in the order in which the node reads them."""
    given = [f"{name}:={json.dumps(value)}" for name, value in GIVEN.get(executable, {}).items()]
    words = ["--ros-args", "--log-level", "fatal", *(w for entry in given for w in ("-p", entry))]
    entries = entry_points(group="console_scripts", name=executable)
    if not entries:
        raise SystemExit(f"{executable} is no executable, filter or visualization")
    _read.clear()
    with patch.object(sys, "argv", [executable, *words]):
        next(iter(entries)).load()()
    return list(_read.values())


_read: dict[str, Row] = {}
_read_parameter, _read_parameter_tree = parameters.read_parameter, parameters.read_parameter_tree


def record(
    node: Node, name: str, what: type, default: object = None, *, description: str = "", **rest: Any
) -> object:
    text = "" if default is None else written(name, default)
    _read[name] = Row(name, kind(what), text, description)
    return _read_parameter(node, name, what, default, description=description, **rest)


def record_tree(node: Node, prefix: str, *, description: str = "", **rest: Any) -> object:
    _read[prefix] = Row(f"{prefix}.*", "", "", description)
    return _read_parameter_tree(node, prefix, description=description, **rest)


def create_and_destroy(create_node: Callable[[], Node]) -> int:
    rclpy.init()
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            create_node().destroy_node()
    except GridMapError:
        pass  # A node opens files and imports packages only after it has declared all parameters.
    finally:
        rclpy.shutdown()
    return 0


# Executables are imported later, so they get the replaced functions.
for module in (nodes, parameters, _spin):
    module.read_parameter, module.read_parameter_tree = record, record_tree  # type: ignore[assignment]
nodes.run = _spin.run = create_and_destroy  # type: ignore[assignment]


# --- cells of the tables --------------------------------------------------------------------------


def kind(hint: Any) -> str:
    """Return the name of a type for the tables, without None, which YAML omits."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Literal:
        return ", ".join(f"`{value}`" for value in arguments)
    if origin in (list, tuple):
        return f"list of {kind(arguments[0])}"
    if origin in (typing.Union, UnionType):
        return " or ".join(kind(each) for each in arguments if each is not NoneType)
    return "string" if hint is str else str(hint.__name__)


def written(name: str, value: object) -> str:
    """Return a value in YAML notation."""
    if name == "color":
        return f"`0x{value:06X}`"
    if isinstance(value, list | tuple):
        return f"`[{', '.join(written('', entry).strip('`') for entry in value)}]`"
    if isinstance(value, str):
        return f"`{value}`" if value else '`""`'
    return f"`{json.dumps(value)}`".replace("NaN", ".nan").replace("Infinity", ".inf")


def table(name: str) -> str:
    """Return the table of an executable, filter, visualization or sensor model."""
    cls = FILTERS.get(name) or VISUALIZATIONS.get(name) or MODELS.get(name)
    rows = rows_of_class(cls) if cls else rows_of_node(name)
    end = ""
    if {row.name for row in rows} >= LIMITS:
        rows = [row for row in rows if row.name not in LIMITS]
        end = "\nLimits of every node: `max_cells`, `max_bytes`, `max_ratio`.\n"
    if not rows:
        return end.lstrip() or "No parameters.\n"
    if nameless := [row.name for row in rows if not row.meaning]:
        raise SystemExit(f"{name}: nothing says what these mean: {', '.join(nameless)}")
    head = ["| parameter | type | default | meaning |", "|---|---|---|---|"]
    return "\n".join([*head, *map(str, rows), end])


def main() -> int:
    """Write or check the tables; return the exit code."""
    parser = argparse.ArgumentParser(description="Write the tables of parameters, from the code.")
    parser.add_argument(
        "--check", action="store_true", help="report outdated tables, write nothing"
    )
    parser.add_argument("pages", type=Path, nargs="*", help="pages (default: all of docs/)")
    options = parser.parse_args()
    # The nodes must not discover other nodes.
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "OFF"
    code = 0
    for page in options.pages or sorted((ROOT / "docs").rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        new = TABLE.sub(lambda found: f"{found[1]}\n{table(found[2])}\n{found[3]}", text)
        if new != text and options.check:
            print(page, "is outdated: run `make tables`")
            code = 1
        elif new != text:
            page.write_text(new, encoding="utf-8")
            print(page, "is written")
    return code


if __name__ == "__main__":
    sys.exit(main())
