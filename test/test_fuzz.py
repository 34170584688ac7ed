# SPDX-License-Identifier: BSD-3-Clause
"""Damaged input raises `GridMapError` only; `make fuzz` tries it for longer."""

import ctypes
import mmap
import re
import threading
from collections.abc import Callable
from pathlib import Path

import fuzz
import numpy as np
import pytest

pytestmark = pytest.mark.needs("mcap", "rasterio", "rosbags", "viser")

CHECKED = {"MCAP", "npz", "command line"}
"""Formats whose checksums, or whose brevity, let hardly any damage pass."""


@pytest.fixture(scope="module")
def targets(tmp_path_factory) -> list[fuzz.Target]:
    return fuzz.targets(tmp_path_factory.mktemp("files"))


def test_damaged_input_is_read_or_raises_grid_map_error(targets):
    for target in targets:
        outcomes = [fuzz.attempt(target, 1, number)[0] for number in range(60)]
        assert outcomes.count(False) > 3, target.name
        assert any(outcomes) or target.name in CHECKED, target.name


def test_intact_input_is_read(targets):
    for target in targets:
        for seed in target.seeds:
            target.read(seed)


def fill_memory(megabytes: int) -> None:
    """Write to memory that Python does not know, and return it."""
    with mmap.mmap(-1, megabytes * 10**6) as memory:
        for place in range(0, len(memory), mmap.PAGESIZE):
            memory[place] = 1


def bad_targets(_folder: Path) -> list[fuzz.Target]:
    # The targets are those of a child process.
    fuzz.PATIENCE, fuzz.LONGEST_WAIT, fuzz.MOST_RESIDENT = 3.0, 1.0, 100e6
    readers: dict[str, Callable[[bytes], object]] = {
        "crashes": lambda _: ctypes.string_at(0),
        "hangs": lambda _: threading.Event().wait(),
        "raises": lambda _: 1 / 0,
        "is greedy": lambda _: np.ones(2**23).sum(),
        "is good": lambda _: b"",
        "waits": lambda _: threading.Event().wait(1.5),
        "fills memory": lambda _: fill_memory(60),
        "fills more memory": lambda _: fill_memory(120),
    }
    return [fuzz.Target(name, [b"seed"], read) for name, read in readers.items()]


def test_crash_hang_error_and_memory_are_findings(capfd):
    assert fuzz.fuzz(bad_targets, 7, seconds=60, inputs=8) == (8, 6)
    output = capfd.readouterr().out
    found = re.findall(r"^finding: --seed 7 --repeat '(.*)' 0: ", output, re.MULTILINE)
    names = ["crashes", "hangs", "raises", "is greedy", "waits", "fills more memory"]
    assert found == names, output
