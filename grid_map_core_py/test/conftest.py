# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Settings of all tests of this package."""

import numpy as np
import pytest

from grid_map_core_py import GridMap


@pytest.fixture
def terrain() -> GridMap:
    values = np.arange(8 * 5, dtype=np.float32).reshape(8, 5)
    return GridMap((8, 5), 1.0, (0.5, 0.0), {"elevation": values, "variance": 0.1}, frame_id="map")
