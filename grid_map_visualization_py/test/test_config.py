# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The parameter files that come with the package."""

from pathlib import Path

import pytest
import yaml

from grid_map_visualization_py import _registry as registry
from grid_map_visualization_py import create

FILES = sorted((Path(__file__).parent.parent / "config").glob("*.yaml"))


def test_there_is_an_example():
    assert [file.name for file in FILES] == ["grid_map_visualization.yaml"]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_every_visualization_can_be_made(file):
    parameters = yaml.safe_load(file.read_text())["grid_map_visualization"]["ros__parameters"]
    names = parameters["grid_map_visualizations"]
    made = {name: create(name, parameters[name]) for name in names}
    assert {type(visualization) for visualization in made.values()} == set(
        registry.BUILT_IN.values()
    )
