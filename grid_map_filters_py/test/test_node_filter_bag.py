# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A chain over a bag: as a function, and as an executable in a process of its own."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_core_py.testing import assert_maps_equal, killed_at_every_step, moved_in_buffer
from grid_map_filters_py import FilterChain, FilterError
from grid_map_filters_py._executables.filter_bag import filter_bag, main
from grid_map_ros_py import BagError, BagReader, BagWriter, bag_maps, save_to_bag

pytest.importorskip("mcap")

CHAIN = """
grid_map_filters:
  ros__parameters:
    filters:
      filter1:
        name: twice
        type: gridMapFilters/MathExpressionFilter
        params: {expression: 2 * height, output_layer: double}
"""
SECOND = 1_000_000_000


def a_map(number: int, layer: str = "height") -> GridMap:
    grid_map = GridMap((1.0, 2.0), 0.5, layers={layer: number}, timestamp=number * SECOND)
    return moved_in_buffer(grid_map, (1, 2))


@pytest.fixture
def chain_file(tmp_path) -> Path:
    (tmp_path / "chain.yaml").write_text(CHAIN)
    return tmp_path / "chain.yaml"


@pytest.fixture
def chain(chain_file) -> FilterChain:
    return FilterChain.from_yaml(chain_file)


@pytest.fixture
def source(tmp_path) -> Path:
    with BagWriter(tmp_path / "source") as bag:
        for number in (1, 2, 3):
            bag.write("/grid_map", a_map(number), time=number * SECOND + 7)
    return tmp_path / "source"


@pytest.fixture
def out(tmp_path) -> Path:
    return tmp_path / "out"


def values(bag: Path) -> list[float]:
    return [float(grid_map["double"][0, 0]) for grid_map in bag_maps(bag, "/filtered_map")]


def test_every_map_is_filtered_and_keeps_its_times_and_start_index(chain, source, out):
    seen = []
    count = filter_bag(chain, source, out, progress=lambda *state: seen.append(state))
    assert (count, seen) == (3, [(1, 3), (2, 3), (3, 3)])
    with BagReader(out) as reader:
        assert (reader.topic, [*reader.topics]) == ("/filtered_map", ["/filtered_map"])
        for number, record in enumerate(reader, 1):
            assert record.time == number * SECOND + 7
            actual = record.grid_map(unwrap=False)
            assert actual.start_index == (1, 2)
            assert_maps_equal(actual, chain(a_map(number)))


def test_a_map_that_fails_ends_it_and_leaves_what_was_there(chain, tmp_path, out):
    save_to_bag([a_map(1), a_map(2, "hight")], tmp_path / "bad", "/grid_map")
    with pytest.raises(FilterError, match=r"map 1: .*no layer 'height'"):
        filter_bag(chain, tmp_path / "bad", out)
    assert not out.exists()
    failures = []
    assert filter_bag(chain, tmp_path / "bad", out, failures=failures) == 1
    assert [failure.index for failure in failures] == [1]
    assert values(out) == [2.0]


def test_a_bag_of_maps_that_all_fail_is_not_written(chain, tmp_path, out):
    save_to_bag(a_map(1, "hight"), tmp_path / "bad", "/grid_map")
    with pytest.raises(BagError, match="no maps to write"):
        filter_bag(chain, tmp_path / "bad", out, failures=[])
    assert not out.exists()


def test_the_source_is_never_replaced(chain, source, tmp_path):
    (tmp_path / "link").symlink_to(source)
    for one in (source, source / "source_0.mcap"):
        for other in (source, tmp_path / "link"):
            with pytest.raises(BagError, match="is the source, too"):
                filter_bag(chain, one, other)


def test_a_run_that_is_killed_leaves_the_old_bag_or_the_new_one(chain, source, tmp_path, out):
    save_to_bag(a_map(9), tmp_path / "other", "/grid_map")
    filter_bag(chain, tmp_path / "other", out)
    found = []
    for _ in killed_at_every_step(lambda: filter_bag(chain, source, out)):
        found.append(values(out))
        filter_bag(chain, tmp_path / "other", out)
    assert found[0] == [18.0]
    assert found[-1] == [2.0, 4.0, 6.0]
    assert all(one in (found[0], found[-1]) for one in found)


def run(*arguments: object) -> subprocess.CompletedProcess:
    command = [
        sys.executable,
        "-m",
        "grid_map_filters_py._executables.filter_bag",
        *map(str, arguments),
    ]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_executable_shows_how_far_it_is(chain_file, source, out):
    options = ["--topic", "/grid_map", "--output-topic", "/twice", "--compression", "zstd"]
    done = run(chain_file, source, out, *options)
    assert (done.returncode, done.stdout) == (0, "")
    bar, result = done.stderr.splitlines()
    assert bar.startswith("[##############################] 3/3 maps, ")
    assert result == f"filter_bag: 3 maps on /twice in {out}"
    assert [float(grid_map["double"][0, 0]) for grid_map in bag_maps(out)] == [2.0, 4.0, 6.0]


@pytest.mark.parametrize(
    ("chain_name", "source_name", "out_name", "options", "reason"),
    [
        ("no.yaml", "source", "out", [], "no.yaml"),
        ("chain.yaml", "no", "out", [], "no: no such file or folder"),
        ("chain.yaml", "source", "out", ["--topic", "/map"], "'/map'; topics: /grid_map"),
        ("chain.yaml", "source", ".", [], "is no bag and not replaced"),
    ],
    ids=["chain", "source", "topic", "out"],
)
def test_the_executable_ends_with_one_message_if_it_cannot_work(
    chain_file, source, tmp_path, capsys, chain_name, source_name, out_name, options, reason
):
    paths = [str(tmp_path / name) for name in (chain_name, source_name, out_name)]
    assert main([*paths, "--quiet", *options]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("filter_bag: ")
    assert reason in line
    assert {*tmp_path.iterdir()} == {chain_file, source}


def test_the_executable_leaves_out_what_fails_if_told_to(chain_file, tmp_path, capsys, out):
    save_to_bag([a_map(1), a_map(2, "hight")], tmp_path / "bad", "/grid_map")
    paths = [str(chain_file), str(tmp_path / "bad"), str(out)]
    assert main([*paths, "--quiet"]) == 1
    assert not out.exists()
    capsys.readouterr()
    assert main([*paths, "--quiet", "--keep-going"]) == 0
    # The message of an expression goes over several lines.
    left_out, *_, result = capsys.readouterr().err.splitlines()
    assert left_out.startswith("filter_bag: left out map 1: ")
    assert result == f"filter_bag: 1 maps on /filtered_map in {out}"


def test_an_interrupt_ends_the_executable_in_peace_and_leaves_nothing(chain_file, tmp_path, out):
    large = GridMap((30, 30), 0.05, layers={"height": np.zeros((600, 600))})
    save_to_bag([large] * 40, tmp_path / "large", "/grid_map", compression="zstd")
    command = [sys.executable, "-m", "grid_map_filters_py._executables.filter_bag"]
    process = subprocess.Popen(
        [*command, chain_file, tmp_path / "large", out], stderr=subprocess.PIPE, text=True
    )
    with process:
        while not [*tmp_path.glob(".out.*")]:
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
    assert (process.returncode, "Traceback" in errors) == (130, False)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["chain.yaml", "large"]
