# SPDX-License-Identifier: BSD-3-Clause
"""A save that is killed or fails leaves the old bag or the new one."""

import itertools
import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from bags import TOPIC, number_of, numbered_map

from grid_map_core_py import GridMap
from grid_map_ros_py import BagError, bag_maps, load_from_bag, save_to_bag
from grid_map_ros_py.bags._mcap import COMPRESSIONS

pytestmark = pytest.mark.needs("mcap", "rosbags")

SAVE_FOR_EVER = """
import sys
sys.path.insert(0, sys.argv[1])
from bags import TOPIC, numbered_map
from grid_map_ros_py import save_to_bag
maps = [numbered_map(number, side=300) for number in range(100)]
print("ready", flush=True)
while True:
    for grid_map in maps:
        save_to_bag(grid_map, sys.argv[2], TOPIC, storage=sys.argv[3])
"""


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_process_killed_at_any_time_leaves_complete_bag(tmp_path, storage):
    path = tmp_path / "bag"
    save_to_bag(numbered_map(0), path, TOPIC)
    for _ in range(2):
        arguments = [str(Path(__file__).parent), str(path), storage]
        process = subprocess.Popen(
            [sys.executable, "-c", SAVE_FOR_EVER, *arguments], stdout=subprocess.PIPE
        )
        assert process.stdout is not None
        with process.stdout:
            assert process.stdout.readline() == b"ready\n"
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(random.uniform(0.05, 0.3))
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert len([*bag_maps(path, TOPIC)]) == 1
    save_to_bag(numbered_map(7), path, TOPIC)
    remains = [entry.suffix for entry in tmp_path.iterdir() if entry != path]
    assert {*remains} <= {".partial"}


def test_error_of_caller_leaves_the_old_bag(tmp_path):
    save_to_bag(numbered_map(1), tmp_path / "bag", TOPIC)

    def maps():
        yield numbered_map(2)
        raise ZeroDivisionError("of the caller")

    with pytest.raises(ZeroDivisionError, match="of the caller"):
        save_to_bag(maps(), tmp_path / "bag", TOPIC)
    assert number_of(load_from_bag(tmp_path / "bag")) == 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["bag"]


@pytest.mark.parametrize("limit", [0, 1000, 20_000])
@pytest.mark.parametrize(
    "options", [{"storage": "sqlite3"}, *({"compression": name} for name in COMPRESSIONS)]
)
def test_full_disk_is_one_error_and_leaves_old_bag(tmp_path, full_disk, limit, options):
    save_to_bag(numbered_map(1), tmp_path / "bag", TOPIC)
    # Chunks that compress well, so that some are still in the file's buffer when the disk is full.
    maps = itertools.repeat(GridMap((45, 45), 0.1, layers={"a": 1.0}))
    with (
        full_disk(limit),
        pytest.raises(BagError, match=r"bag: cannot be written: (File too large|disk I/O error)"),
    ):
        save_to_bag(maps, tmp_path / "bag", TOPIC, **options)
    assert number_of(load_from_bag(tmp_path / "bag")) == 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["bag"]


def test_failed_synchronization_is_one_error_and_leaves_old_bag(tmp_path, monkeypatch):
    save_to_bag(numbered_map(1), tmp_path / "bag", TOPIC)

    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(BagError, match="bag: cannot be written: No space left on device"):
        save_to_bag(numbered_map(2), tmp_path / "bag", TOPIC)
    monkeypatch.undo()
    assert number_of(load_from_bag(tmp_path / "bag")) == 1
