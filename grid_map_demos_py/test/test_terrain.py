# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The ground that the demos stand on."""

import numpy as np
import pytest

from conftest import MODEL
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.testing import assert_maps_equal
from grid_map_demos_py.terrain import EXAGGERATION, METRES_PER_POST, load_terrain


def test_the_terrain_is_large_not_square_and_has_holes(terrain):
    assert min(terrain.size) >= 300
    assert terrain.size[0] != terrain.size[1]
    share = np.isnan(terrain["elevation"]).mean()
    assert 0.01 < share < 0.1
    np.testing.assert_array_equal(np.isnan(terrain["color"]), np.isnan(terrain["elevation"]))


def test_x_points_east_and_y_north(terrain):
    with np.load(MODEL) as model:
        posts = model["elevation"]
    scale = EXAGGERATION * terrain.resolution / METRES_PER_POST
    half = 0.5 * (terrain.length - terrain.resolution)
    corners = {(-1, 1): posts[0, 0], (1, 1): posts[0, -1], (-1, -1): posts[-1, 0]}
    for side, height in corners.items():
        index = terrain.get_index(terrain.position + np.multiply(side, half))
        expected = (height - posts.min()) * scale
        np.testing.assert_allclose(terrain["elevation"][index], expected, rtol=1e-5)


def test_the_terrain_is_always_the_same(terrain):
    assert_maps_equal(load_terrain(MODEL), terrain)


def test_a_file_that_does_not_exist_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"nope\.npz'.*FileNotFoundError"):
        load_terrain(tmp_path / "nope.npz")


@pytest.mark.parametrize("content", [b"", b"P5 2 2 255 abcd", b"PK\x03\x04 and nothing else"])
def test_a_file_that_is_no_npz_is_refused(tmp_path, content):
    path = tmp_path / "terrain.npz"
    path.write_bytes(content)
    with pytest.raises(
        ConfigError, match=r"terrain\.npz': expected an \.npz file with 'elevation'"
    ):
        load_terrain(path)


def test_a_damaged_file_is_refused(tmp_path):
    path = tmp_path / "terrain.npz"
    data = bytearray(MODEL.read_bytes())
    data[len(data) // 3 : 2 * len(data) // 3] = bytes(2 * len(data) // 3 - len(data) // 3)
    path.write_bytes(data)
    with pytest.raises(ConfigError, match="expected an"):
        load_terrain(path)


def test_a_file_with_other_arrays_is_refused(tmp_path):
    path = tmp_path / "terrain.npz"
    np.savez(path, height=np.zeros((3, 3)))
    with pytest.raises(ConfigError, match=r"'elevation'.*found KeyError"):
        load_terrain(path)


@pytest.mark.parametrize("shape", [(), (4,), (0, 3), (2, 3, 4)])
def test_an_elevation_without_rows_and_columns_is_refused(tmp_path, shape):
    path = tmp_path / "terrain.npz"
    np.savez(path, elevation=np.zeros(shape))
    with pytest.raises(ConfigError, match="rows and columns, found the shape"):
        load_terrain(path)
