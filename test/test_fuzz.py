# SPDX-License-Identifier: BSD-3-Clause
"""Damaged input raises `GridMapError` only; `make fuzz` tries it for longer."""

import fuzz
import pytest

pytestmark = pytest.mark.needs("mcap", "rasterio", "rosbags", "viser")


def test_damaged_input_is_read_or_raises_grid_map_error(tmp_path):
    for target in fuzz.targets(tmp_path):
        outcomes = [fuzz.attempt(target, 1, number) for number in range(30)]
        assert False in outcomes, target.name
