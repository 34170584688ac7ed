# SPDX-License-Identifier: BSD-3-Clause
"""Settings of all tests of this package."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_core_py._loops import Loop


@pytest.fixture
def terrain() -> GridMap:
    values = np.arange(8 * 5, dtype=np.float32).reshape(8, 5)
    return GridMap((8, 5), 1.0, (0.5, 0.0), {"elevation": values, "variance": 0.1}, frame_id="map")


@pytest.fixture
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of the test, which is the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def cluster() -> Iterator[Any]:
    """Client of two processes; it computes within its `as_current()` only."""
    from distributed import Client, LocalCluster

    options = {"threads_per_worker": 1, "dashboard_address": None, "silence_logs": 60}
    with LocalCluster(2, **options) as cluster, Client(cluster, set_as_default=False) as client:
        yield client


@pytest.fixture(params=[pytest.param("compiled", marks=pytest.mark.needs("numba")), "arrays"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both ways: loops that numba has compiled, and NumPy alone."""
    if request.param == "arrays":
        monkeypatch.setattr(Loop, "compiled", lambda _: None)
