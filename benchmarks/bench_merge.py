# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of merging two maps and of transforming a map to another frame."""

import numpy as np
import pytest
from terrain import terrain


def other_terrain(cells):
    """Return the terrain, raised by 10 m and shifted by 1/4 (x) and 1/8 (y) of its side."""
    grid_map = terrain(cells)
    grid_map.position = grid_map.length * (1 / 4, 1 / 8)
    grid_map["elevation"] += 10
    return grid_map


@pytest.mark.parametrize("extend", [True, False], ids=["extend", "no extend"])
def test_add_data_from(measure, cells, extend):
    grid_map, other = terrain(cells), other_terrain(cells)

    def add(grid_map):
        grid_map.add_data_from(other, extend_map=extend, overwrite_data=True)
        return grid_map

    row = f"addDataFrom {'extend' if extend else 'no extend'} overwrite copyAll"
    result = measure(row, cells, add, prepare=lambda: (grid_map.copy(),))
    quarter, eighth = cells // 4, cells // 8
    assert result.size == ((cells + quarter, cells + eighth) if extend else (cells, cells))
    before, added = grid_map["elevation"], other["elevation"]
    # The first quarter of rows and eighth of columns are covered only by the other map.
    after = result["elevation"][-cells:, -cells:]
    overlap = added[quarter:, eighth:]
    expected = before.copy()
    kept = np.isnan(overlap)
    expected[:-quarter, :-eighth] = np.where(kept, before[:-quarter, :-eighth], overlap)
    np.testing.assert_array_equal(after, expected)
    if extend:
        np.testing.assert_array_equal(result["elevation"][:quarter, :cells], added[:quarter])


def yaw30_pitch5():
    yaw, pitch = np.radians((30.0, 5.0))
    turn, tilt = np.eye(4), np.eye(4)
    turn[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    tilt[:3:2, :3:2] = [[np.cos(pitch), np.sin(pitch)], [-np.sin(pitch), np.cos(pitch)]]
    return turn @ tilt


@pytest.mark.parametrize("ratio", [0, 0.25])
def test_transformed_map(measure, cells, ratio):
    grid_map, transform = terrain(cells), yaw30_pitch5()
    result = measure(
        f"getTransformedMap yaw30 pitch5 sampleRatio={ratio}",
        cells,
        lambda: grid_map.get_transformed_map(transform, "elevation", "tilted", ratio),
    )
    highest = np.full(result.size, -np.inf, dtype=np.float32)
    for step in np.array([(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)])[: 5 if ratio else 1]:
        cells, heights = landed(grid_map, transform, step * ratio * grid_map.resolution, result)
        np.maximum.at(highest, cells, heights)
    highest[np.isinf(highest)] = np.nan
    # Rounding differences may move a point across a cell border.
    equal = np.isclose(result["elevation"], highest, equal_nan=True)
    assert equal.mean() > 0.9999


def landed(grid_map, transform, step, result):
    """Return the cells of `result` that the transformed points hit, and the point heights."""
    z = grid_map["elevation"].ravel("F")
    points = np.column_stack([grid_map.get_positions() + step, z, np.ones_like(z)])
    moved = points[np.isfinite(z)] @ transform.T
    (rows, cols), inside = result.get_indices(moved[:, :2])
    return (rows[inside], cols[inside]), moved[inside, 2].astype(np.float32)
