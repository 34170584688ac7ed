# SPDX-License-Identifier: BSD-3-Clause
"""The loader of all YAML files, which reads numbers as ROS does."""

import re
from os import PathLike
from pathlib import Path
from typing import Any

import yaml

from ..errors import GridMapError


class _Loader(yaml.SafeLoader):
    """YAML in which `1e-3` is a number and the keys of a mapping are unique."""

    def flatten_mapping(self, node: Any) -> None:
        """Check the keys of a mapping before merged ones are added to them."""
        if not hasattr(node, "checked"):
            node.checked, known = True, set()
            for key, _ in node.value:
                if isinstance(key, yaml.ScalarNode) and key.value in known:
                    problem = f"{key.value!r:.100} occurs twice"
                    raise yaml.constructor.ConstructorError(None, None, problem, key.start_mark)
                known.add(key.value if isinstance(key, yaml.ScalarNode) else None)
        super().flatten_mapping(node)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def load_yaml(path: str | PathLike[str]) -> Any:
    """Return the content of a YAML file.

    Numbers such as `1e-3` are read as ROS reads them, and keys are unique.

    Raises:
        GridMapError: the file cannot be read, or see `parse_yaml`.
    """
    try:
        text = Path(path).read_bytes()
    except OSError as error:
        raise GridMapError(f"{path}: cannot be read: {error.strerror or error}") from error
    return parse_yaml(text, path)


def parse_yaml(text: str | bytes, name: object) -> Any:
    """Return the content of a YAML text; `name` names it in errors.

    Raises:
        GridMapError: the text is no YAML, or a key occurs twice.
    """
    try:
        return yaml.load(text, _Loader)
    # Values that do not fit their tags, such as `!!int x`, raise errors of many classes.
    except Exception as error:
        problem = " ".join(str(error).split())
        raise GridMapError(f"{name}: no valid YAML: {problem:.300}") from error
