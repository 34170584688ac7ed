# SPDX-License-Identifier: BSD-3-Clause
"""Settings and fixtures of all tests of this package."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml

from grid_map_ros_py import testing
from grid_map_ros_py.testing import Peer


@pytest.fixture
def peer() -> Iterator[Peer]:
    with testing.peer() as other:
        yield other


@pytest.fixture
def arguments(tmp_path: Path) -> Callable[..., list[str]]:
    """Return a function that returns the arguments with which the node has these parameters."""

    def write(**parameters: object) -> list[str]:
        path = tmp_path / "parameters.yaml"
        path.write_text(yaml.safe_dump({"grid_map_visualization": {"ros__parameters": parameters}}))
        return ["--ros-args", "--params-file", str(path)]

    return write
