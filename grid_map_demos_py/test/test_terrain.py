# SPDX-License-Identifier: BSD-3-Clause
"""The demo terrain."""

import cv2
import numpy as np
import pytest

from conftest import MODEL
from grid_map_core_py.errors import GridMapError
from grid_map_demos_py.terrain import EXAGGERATION, METRES_PER_POST, load_terrain
from grid_map_filters_py import FilterChain


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
    np.testing.assert_array_equal(np.isnan(terrain["color"]), np.isnan(terrain["elevation"]))


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


def test_costs_for_nav2_follow_traversability_and_steps(terrain):
    chain = FilterChain.from_yaml(MODEL.parents[1] / "config" / "nav2_costs_filter_chain.yaml")
    result = chain(terrain)
    traversability, cost, inflated = (
        result[name] for name in ("traversability", "cost", "inflated_cost")
    )
    lethal = (traversability <= 0.25) | (result["step_height"] > 0.07)
    np.testing.assert_array_equal(cost == 254, lethal)
    np.testing.assert_array_equal(cost == 0, (traversability >= 0.8) & ~lethal)
    np.testing.assert_array_equal(np.isnan(cost), np.isnan(traversability))
    for cells in (lethal, cost == 0, np.isnan(cost)):
        assert 0.002 < cells.mean() < 0.5
    # The inscribed radius is two cells, and the inflation radius ten.
    known, mask = ~np.isnan(cost), lethal.astype(np.uint8)
    near = cv2.dilate(mask, np.uint8([[0, 1, 0], [1, 1, 1], [0, 1, 0]]), iterations=2)
    assert (inflated[near > 0] >= 253).all()
    far = cv2.dilate(mask, np.ones((21, 21), np.uint8)) == 0
    np.testing.assert_array_equal(inflated[known & far], cost[known & far])
    assert (inflated[known] >= cost[known]).all()
