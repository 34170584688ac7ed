# SPDX-License-Identifier: BSD-3-Clause
"""The terrain of the demos."""

import subprocess
import sys

import numpy as np
import pytest

from conftest import MODEL
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.testing import assert_maps_equal
from grid_map_demos_py.terrain import EXAGGERATION, METRES_PER_POST, load_terrain


def test_import_leaves_interrupts_to_the_program():
    program = (
        "import signal, grid_map_demos_py.terrain;"
        "assert signal.getsignal(signal.SIGINT) is signal.default_int_handler"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


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


DAMAGED = bytearray(MODEL.read_bytes())
DAMAGED[len(DAMAGED) // 3 : 2 * len(DAMAGED) // 3] = bytes(len(DAMAGED) // 3)


@pytest.mark.parametrize("content", [None, b"", b"P5 2 2 255 abcd", b"PK\x03\x04 no more", DAMAGED])
def test_missing_or_damaged_file_is_named(tmp_path, content):
    path = tmp_path / "terrain.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(GridMapError, match=r"terrain\.npz: cannot be read: "):
        load_terrain(path)


@pytest.mark.parametrize(
    ("arrays", "found"),
    [({"height": np.zeros((3, 3))}, "elevation.* is missing")]
    + [
        ({"elevation": np.zeros(shape)}, "rows and columns, got the shape")
        for shape in [(), (4,), (0, 3), (2, 3, 4)]
    ],
)
def test_file_without_a_grid_of_elevations_is_refused(tmp_path, arrays, found):
    path = tmp_path / "terrain.npz"
    np.savez(path, **arrays)
    with pytest.raises(GridMapError, match=found):
        load_terrain(path)
