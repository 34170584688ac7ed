# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Pictures on disk."""

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

from grid_map_core_py import GridMap
from grid_map_core_py.testing import moved_in_buffer
from grid_map_demos_py.picture import extent, save_picture, upright


@pytest.fixture
def corner_map() -> GridMap:
    """A map that is 1 in the corner of the largest x and y and NaN beside it."""
    grid_map = GridMap((3.0, 2.0), 0.5, (10.0, 20.0), {"a": 0.0, "ground": 0.0})
    grid_map["a"][0, 0] = 1.0
    grid_map["a"][1, 0] = np.nan
    return grid_map


@pytest.mark.parametrize("start", [(0, 0), (3, 2)])
def test_x_runs_to_the_right_and_y_upwards(corner_map, start):
    image = upright(moved_in_buffer(corner_map, start), "a")
    assert image.shape == (4, 6)
    assert image[0, -1] == 1.0
    assert np.isnan(image[0, -2])
    assert extent(corner_map) == (8.5, 11.5, 19.0, 21.0)


def test_a_picture_replaces_the_old_one_and_leaves_nothing_else(corner_map, tmp_path):
    path = tmp_path / "picture.png"
    path.write_bytes(b"old")
    save_picture(corner_map, "a", path, shade_by="ground", title="t", label="a")
    image = matplotlib.image.imread(path)
    assert image.shape[0] > 300
    assert len(np.unique(image.reshape(-1, image.shape[-1]), axis=0)) > 50
    assert [file.name for file in tmp_path.iterdir()] == ["picture.png"]


def test_a_picture_of_a_missing_layer_leaves_the_old_one(corner_map, tmp_path):
    path = tmp_path / "picture.png"
    path.write_bytes(b"old")
    with pytest.raises(KeyError):
        save_picture(corner_map, "b", path, shade_by="ground", title="t", label="b")
    assert path.read_bytes() == b"old"


def test_a_picture_that_cannot_be_finished_leaves_the_old_one_alone(
    corner_map, tmp_path, monkeypatch
):
    def fill_the_disk(_figure, file, **_options):
        file.write_bytes(b"half a pic")
        raise OSError("no space left on device")

    monkeypatch.setattr(Figure, "savefig", fill_the_disk)
    path = tmp_path / "picture.png"
    path.write_bytes(b"old")
    with pytest.raises(OSError, match="no space left"):
        save_picture(corner_map, "a", path, shade_by="ground", title="t", label="a")
    assert path.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["picture.png"]


def test_a_layer_without_data_gives_a_picture(corner_map, tmp_path):
    corner_map["a"] = np.nan
    path = tmp_path / "empty.png"
    save_picture(corner_map, "a", path, shade_by="ground", title="t", label="a")
    assert path.stat().st_size > 1000
