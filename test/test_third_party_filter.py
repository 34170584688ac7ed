# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The example package of the page on filters, installed and used from YAML."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from pages import page

from scratch import run

USE = """
import sys
from grid_map_core_py import GridMap
from grid_map_filters_py import FILTERS, FilterChain, FilterError
try:
    chain = FilterChain.from_yaml(sys.argv[1])
except FilterError as error:
    sys.exit(str(error))
print(chain(GridMap((1.0, 1.0), 0.5, layers={"elevation": 2.0}))["elevation"].max())
"""


def example() -> dict[str, str]:
    """Return the files of the package: the blocks of the page that name a file."""
    blocks = page("docs/filters.md").blocks
    named = {re.search(r'file="([^"]*)"', block.info): block.text for block in blocks}
    return {found[1]: text for found, text in named.items() if found}


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """Return a folder with the files of the package."""
    folder = tmp_path_factory.mktemp("my_filters")
    for name, text in example().items():
        (folder / name).write_text(text)
    return folder


@pytest.fixture(scope="module")
def installed(source, tmp_path_factory) -> Path:
    """Return a folder where the package is installed as colcon does it, without a network."""
    target = tmp_path_factory.mktemp("installed")
    options = f"--install-lib={target}", "--single-version-externally-managed", "--record=files"
    command = (sys.executable, "setup.py", "--quiet", "install", *options)
    done = run(*command, environ=os.environ, cwd=source)
    assert done.returncode == 0, done.stderr
    return target


def use(chain: Path, installed: Path) -> "subprocess.CompletedProcess[str]":
    path = os.pathsep.join([str(installed), os.environ["PYTHONPATH"]])
    environ = {**os.environ, "PYTHONPATH": path}
    return run(sys.executable, "-c", USE, chain, environ=environ, cwd=chain.parent)


def test_the_page_shows_the_whole_package():
    assert sorted(example()) == ["chain.yaml", "offset_filter.py", "setup.py"]


def test_yaml_names_a_filter_of_another_package(source, installed):
    assert not (installed / "setup.py").exists()
    done = use(source / "chain.yaml", installed)
    assert (done.stdout, done.stderr) == ("3.5\n", "")


@pytest.mark.parametrize(
    ("found", "text", "message"),
    [
        (
            "offset: 1.5",
            "offset: high",
            "parameter 'offset': expected a number, got 'high' (str)",
        ),
        (
            "offset: 1.5",
            "offset: .inf",
            "parameter 'offset': expected a finite number, got inf (float)",
        ),
        ("offset: 1.5", "ofset: 1", "unknown parameter 'ofset'; known: layer, offset"),
    ],
)
def test_parameters_of_third_party_filter_are_checked(
    source, installed, tmp_path, found, text, message
):
    chain = tmp_path / "chain.yaml"
    chain.write_text((source / "chain.yaml").read_text().replace(found, text))
    done = use(chain, installed)
    assert done.stderr == f"filter 1 'raise' (myFilters/OffsetFilter): {message}\n"
