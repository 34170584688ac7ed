# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""YAML files of other programs, read with limits on size and depth."""

from os import PathLike
from pathlib import Path
from typing import Any

import yaml

from ..errors import GridMapError

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_DEEPEST = 50
"""Maximum number of nested levels; the fast loader crashes on very many."""


def load_yaml(path: str | PathLike[str], largest: int = 4 * 2**20) -> Any:
    """Return the content of a YAML file of at most `largest` bytes.

    Raises:
        GridMapError: the file is missing, too large, nested too deeply, or no YAML.
    """
    file = Path(path)
    try:
        if file.stat().st_size > largest:
            raise GridMapError(f"{file}: larger than {largest} bytes")
        text = file.read_bytes()
        depth = 0
        for event in yaml.parse(text, _Loader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST:
                raise GridMapError(f"{file}: nested more than {_DEEPEST} times")
        return yaml.load(text, _Loader)
    except OSError as error:
        raise GridMapError(f"{file}: cannot be read: {error.strerror}") from error
    # PyYAML raises ValueError for a date that does not exist.
    except (yaml.YAMLError, ValueError) as error:
        problem = " ".join(str(error).split())
        raise GridMapError(f"{file}: no valid YAML: {problem}") from error
