# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The package that the page of filters shows, written to a folder, installed and used from YAML."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pages import page

from grid_map_core_py import GridMap
from grid_map_core_py.testing import assert_maps_equal
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, to_message
from grid_map_ros_py.testing import Process, peer, running
from scratch import run

NODE = "grid_map_filters_py._executables.filter_chain"

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
    """Return the files of the package, those blocks of the page that name one."""
    blocks = page("docs/filters.md").blocks
    named = {re.search(r'file="([^"]*)"', block.info): block.text for block in blocks}
    return {found[1]: text for found, text in named.items() if found}


def write(folder: Path, old: str = "", new: str = "") -> Path:
    """Write the package into a folder, with one text in its files replaced by another."""
    folder.mkdir()
    for name, text in example().items():
        (folder / name).write_text(text.replace(old, new) if old else text)
    return folder


def install(source: Path) -> Path:
    """Install a package into a folder of its own, as colcon does, without a network."""
    target = source.with_name(f"{source.name}_installed")
    options = f"--install-lib={target}", "--single-version-externally-managed", "--record=files"
    command = (sys.executable, "setup.py", "--quiet", "install", *options)
    done = run(*command, environ=os.environ, cwd=source)
    assert done.returncode == 0, done.stderr
    return target


def with_path(*folders: Path) -> dict[str, str]:
    return {"PYTHONPATH": os.pathsep.join([*map(str, folders), os.environ["PYTHONPATH"]])}


def use(chain: Path, *folders: Path) -> "subprocess.CompletedProcess[str]":
    environ = {**os.environ, **with_path(*folders)}
    return run(sys.executable, "-c", USE, chain, environ=environ, cwd=chain.parent.parent)


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    return write(tmp_path_factory.mktemp("third_party") / "my_filters")


@pytest.fixture(scope="module")
def installed(source) -> Path:
    return install(source)


def test_the_page_shows_the_whole_package():
    assert sorted(example()) == ["chain.yaml", "offset_filter.py", "setup.py"]


def test_yaml_names_a_filter_of_another_package(source, installed):
    assert not (installed / "setup.py").exists()
    done = use(source / "chain.yaml", installed)
    assert (done.stdout, done.stderr) == ("3.5\n", "")


def test_filter_is_unknown_without_its_package(source):
    done = use(source / "chain.yaml")
    assert done.returncode == 1
    assert "filter 1 'raise' (myFilters/OffsetFilter): unknown type" in done.stderr


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


def test_the_node_runs_it(source, installed):
    arguments = ["-m", NODE, "--ros-args", "--params-file", str(source / "chain.yaml")]
    sent = GridMap((2.0, 1.0), 0.5, layers={"elevation": np.arange(8).reshape(4, 2)})
    process = Process([sys.executable, *arguments], with_path(installed))
    with peer() as other, running(process):
        other.listen("/filtered_map", GridMapMessage)
        other.publish("/grid_map", to_message(sent))
        received = from_message(other.expect("/filtered_map"))
    sent["elevation"] += 1.5
    assert_maps_equal(received, sent)


def test_the_node_ends_with_one_message_about_a_broken_filter(tmp_path):
    broken = write(tmp_path / "broken", "offset_filter:Offset", "ofset_filter:Offset")
    arguments = ["-m", NODE, "--ros-args", "--params-file", str(broken / "chain.yaml")]
    node = Process([sys.executable, *arguments], with_path(install(broken)))
    assert node.wait() == 1
    (line,) = node.text.strip().splitlines()
    assert line.endswith(
        "filter 1 'raise' (myFilters/OffsetFilter): "
        "cannot load 'ofset_filter:Offset': No module named 'ofset_filter'"
    )
