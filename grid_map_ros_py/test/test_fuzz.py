# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Damaged input raises `GridMapError` only; `make fuzz` tries it for longer."""

import fuzz
import pytest

TARGETS = fuzz.targets()
SECONDS = 10 / len(TARGETS)
CHECKED = {"MCAP", "npz", "map.yaml", "PNG"}
"""Formats whose checksums, or whose brevity, let hardly any damage pass."""


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_damaged_input_is_read_or_raises_grid_map_error(target):
    counts = fuzz.fuzz(target, SECONDS, seed=1)
    assert counts["refused"] > 5
    assert counts["read"] > 0 or target.name in CHECKED


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_intact_input_is_read(target):
    for seed in target.seeds:
        target.read(seed)
