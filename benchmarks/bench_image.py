# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of image conversions and resolution changes."""

import cv2
import numpy as np
from terrain import RESOLUTION, terrain

from grid_map_core_py.conversions import change_resolution, to_image


def test_to_image(measure, cells):
    grid_map = terrain(cells)
    row = "toCvImage mono8 (GridMapCvConverter::toImage<uchar,1>)"
    image = measure(row, cells, lambda: to_image(grid_map, "elevation", np.uint8, 1))
    elevation = grid_map["elevation"]
    known = np.isfinite(elevation)
    lowest, highest = elevation[known].min(), elevation[known].max()
    expected = 255 * (elevation[known] - lowest) / (highest - lowest)
    np.testing.assert_allclose(image[known] + 0.5, expected, atol=0.51)
    assert not image[~known].any()


def test_change_resolution(measure, cells):
    grid_map = terrain(cells)
    row = "GridMapCvProcessing::changeResolution 0.05->0.1 cubic"
    change = lambda: change_resolution(grid_map, 2 * RESOLUTION, cv2.INTER_CUBIC)  # noqa: E731
    result = measure(row, cells, change)["elevation"]
    assert result.shape == (cells // 2, cells // 2)
    assert 0.04 < np.isnan(result).mean() < 0.06
    elevation = grid_map["elevation"]
    quarters = np.stack([elevation[row::2, column::2] for row in (0, 1) for column in (0, 1)])
    whole = np.isfinite(quarters).all(axis=0)
    # Apart from curvature effects, a cell is the mean of the four cells that it covers.
    np.testing.assert_allclose(result[whole], quarters.mean(axis=0)[whole], atol=0.02)
