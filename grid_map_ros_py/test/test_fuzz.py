# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Damaged input raises `GridMapError` only; `make fuzz` tries it for longer."""

import fuzz
import pytest

pytestmark = pytest.mark.needs("mcap", "rosbags")

CHECKED = {"MCAP", "npz", "map.yaml", "PNG"}
"""Formats whose checksums, or whose brevity, let hardly any damage pass."""


@pytest.fixture(scope="module")
def targets() -> list[fuzz.Target]:
    # Not when the module is imported, because its files need optional packages.
    return fuzz.targets()


def test_damaged_input_is_read_or_raises_grid_map_error(targets):
    for target in targets:
        counts = fuzz.fuzz(target, 10 / len(targets), seed=1)
        assert counts["refused"] > 5, target.name
        assert counts["read"] > 0 or target.name in CHECKED, target.name


def test_intact_input_is_read(targets):
    for target in targets:
        for seed in target.seeds:
            target.read(seed)
