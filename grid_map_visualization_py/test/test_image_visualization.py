# SPDX-License-Identifier: BSD-3-Clause
"""Layers as images."""

import numpy as np
import pytest
from hypothesis import given, settings
from messages import drawn
from sensor_msgs.msg import Image

from grid_map_core_py import GridMap, color_vector_to_value
from grid_map_core_py.testing import grid_maps
from grid_map_visualization_py.colors import MISSING


def pixels(message: Image) -> np.ndarray:
    """Return (height, width, channels)."""
    return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, -1)


@settings(max_examples=40)
@given(grid_maps(max_side=6))
def test_every_pixel_is_the_cell_at_its_place(grid_map):
    message = drawn("image", grid_map, layer="elevation", color_map="gray", encoding="rgba8")
    image, values = pixels(message), grid_map.unwrapped("elevation")
    assert image.shape == (*grid_map.size, 4)
    assert message.step == 4 * message.width
    assert ((image[..., 3] == 0) == np.isnan(values)).all()
    order = np.argsort(values, axis=None)[: np.count_nonzero(~np.isnan(values))]
    assert (np.diff(image[..., 0].ravel()[order].astype(int)) >= 0).all()
    assert (image[..., 0] == image[..., 2]).all()


@pytest.mark.parametrize(
    ("encoding", "expected"),
    [
        ("rgb8", [[1, 2, 3], [MISSING] * 3]),
        ("bgr8", [[3, 2, 1], [MISSING] * 3]),
        ("rgba8", [[1, 2, 3, 255], [MISSING, MISSING, MISSING, 0]]),
        ("bgra8", [[3, 2, 1, 255], [MISSING, MISSING, MISSING, 0]]),
    ],
)
def test_packed_colors_in_the_order_of_the_encoding(encoding, expected):
    layer = np.array([[color_vector_to_value((1, 2, 3)), np.nan]])
    grid_map = GridMap((1, 2), 1.0, layers={"color": layer})
    message = drawn("image", grid_map, layer="color", color_mode="color", encoding=encoding)
    assert pixels(message).tolist() == [expected]
    assert message.encoding == encoding
