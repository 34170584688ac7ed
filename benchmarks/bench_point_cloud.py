# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of layers from clouds and meshes, in yardsticks only; C++ was not timed."""

import numpy as np
import pytest
from terrain import RESOLUTION

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import (
    PointCloudPipeline,
    downsample,
    rasterize,
    rasterize_triangles,
)

POINTS = 1_000_000
CELLS = 400
SIDE = CELLS * RESOLUTION


def cloud(points: int = POINTS) -> np.ndarray:
    """Return points on wavy ground, on the map and slightly beyond its border."""
    rng = np.random.default_rng(1)
    xy = rng.uniform(-0.51 * SIDE, 0.51 * SIDE, (points, 2))
    return np.column_stack([xy, ground(*xy.T) + rng.normal(0, 0.01, points)]).astype(np.float32)


def ground(x, y):
    return 0.3 * np.sin(1.3 * x) * np.cos(0.9 * y)


def by_cell(points: np.ndarray, grid_map: GridMap) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the cells (n, 2) that contain points, and the heights in each cell, in input order."""
    (rows, cols), inside = grid_map.get_indices(points[:, :2])
    flat = np.ravel_multi_index((rows[inside], cols[inside]), grid_map.size)
    order = np.argsort(flat, kind="stable")
    cells, first = np.unique(flat[order], return_index=True)
    heights = np.split(points[inside, 2][order].astype(np.float64), first[1:])
    return np.column_stack(np.unravel_index(cells, grid_map.size)), heights


ORACLES = {
    "max": np.max,
    "min": np.min,
    "mean": np.mean,
    "median": np.median,
    "first": lambda heights: heights[0],
    "last": lambda heights: heights[-1],
    "count": np.size,
    "variance": np.var,
}


@pytest.mark.parametrize("reduction", ORACLES)
def test_rasterize(measure, reduction):
    points, grid_map = cloud(), GridMap((SIDE, SIDE), RESOLUTION)
    row = f"rasterize 1e6 points, {reduction}"
    layer = measure(row, CELLS, lambda: rasterize(points, grid_map, {"z": reduction}))["z"]
    cells, heights = by_cell(points, grid_map)
    some = slice(None, None, 50)
    expected = [ORACLES[reduction](values) for values in heights[some]]
    np.testing.assert_allclose(layer[tuple(cells[some].T)], expected, rtol=1e-4)


def test_rasterize_several_layers_at_once(measure):
    points, grid_map = cloud(), GridMap((SIDE, SIDE), RESOLUTION)
    layers = {"elevation": "max", "mean": "mean", "variance": "variance", "count": "count"}
    fields = {"intensity": points[:, 0].copy()}
    result = measure(
        "rasterize 1e6 points, four layers and a field",
        CELLS,
        lambda: rasterize(points, grid_map, layers, fields=fields),
    )
    x, _ = grid_map.axes()
    distance = np.abs(result["intensity"] - x[:, None])
    assert np.nanmax(distance) <= 0.5 * RESOLUTION + 1e-6


def test_pipeline(measure):
    points = cloud()
    pipeline = PointCloudPipeline(num_processing_threads=1)
    grid_map = measure("point cloud pipeline 1e6 points", CELLS, lambda: pipeline(points))
    means = rasterize(points, grid_map, {"mean": "mean", "count": "count"})
    enough = means["count"] >= 2
    np.testing.assert_allclose(grid_map["elevation"][enough], means["mean"][enough], atol=1e-5)


def test_downsample(measure):
    points = cloud()
    result = measure("voxel downsampling 1e6 points", CELLS, lambda: downsample(points, (1, 1, 9)))
    voxels = np.unique(np.floor(points / (1, 1, 9)), axis=0)
    assert len(result) == len(voxels)


@pytest.mark.parametrize("squares", [1, 20, 707])
def test_mesh(measure, squares):
    steps = np.linspace(-0.5 * SIDE, 0.5 * SIDE, squares + 1)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), 0.5 * x.ravel() - y.ravel()])
    corner = np.arange(squares * (squares + 1)).reshape(squares, -1)[:, :-1].ravel()
    other = corner + squares + 2
    faces = np.concatenate(
        [
            np.column_stack([corner, corner + 1, other]),
            np.column_stack([corner, other, other - 1]),
        ]
    )
    grid_map = GridMap((SIDE, SIDE), RESOLUTION)
    row = f"rasterize_triangles {len(faces)}"
    layer = measure(row, CELLS, lambda: rasterize_triangles(vertices, faces, grid_map))["elevation"]
    x, y = grid_map.axes()
    np.testing.assert_allclose(layer, 0.5 * x[:, None] - y[None, :], atol=1e-5)
