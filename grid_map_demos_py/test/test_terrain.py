# SPDX-License-Identifier: BSD-3-Clause
"""The demo terrain."""

import numpy as np
import pytest

from conftest import MODEL
from grid_map_core_py.errors import GridMapError
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


def test_missing_or_damaged_file_is_named(tmp_path):
    path, damaged = tmp_path / "terrain.npz", bytearray(MODEL.read_bytes())
    damaged[len(damaged) // 3 : 2 * len(damaged) // 3] = bytes(len(damaged) // 3)
    for content in (None, b"", b"P5 2 2 255 abcd", b"PK\x03\x04 no more", damaged):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(GridMapError, match=r"terrain\.npz: cannot be read: "):
            load_terrain(path)
    for name, shape, found in [
        ("height", (3, 3), "elevation.* is missing"),
        *(("elevation", shape, "rows and columns, got the") for shape in [(), (4,), (0, 3)]),
    ]:
        np.savez(path, **{name: np.zeros(shape)})
        with pytest.raises(GridMapError, match=found):
            load_terrain(path)
