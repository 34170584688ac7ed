# SPDX-License-Identifier: BSD-3-Clause
"""Surfaces made of planes, sampled as maps with 4 cm cells and noise, and Shapely polygons."""

import numpy as np

from grid_map_core_py import GridMap

RESOLUTION = 0.04


def sampled(surface, size, seed, *, share=6, outliers=0.0):
    """Return a map of a surface with noise of 5 mm, and the heights without it.

    Args:
        surface: function of x and y [m] that returns heights [m].
        size: number of rows and columns.
        share: samples per cell and axis; a cell gets their mean, as from many points. 1 samples the
            cell center.
        outliers: share of cells that are up to 0.5 m too high or low.
    """
    grid_map = GridMap.from_array(np.zeros(size), RESOLUTION)
    offsets = ((np.arange(share) + 0.5) / share - 0.5) * RESOLUTION
    x, y = (np.add.outer(axis, offsets).ravel() for axis in grid_map.axes())
    heights = np.broadcast_to(surface(x[:, None], y[None]), (x.size, y.size))
    heights = heights.reshape(size[0], share, size[1], share).mean(axis=(1, 3))
    random = np.random.default_rng(seed)
    measured = heights + 0.005 * random.standard_normal(size)
    wrong = random.random(size) < outliers
    measured[wrong] += random.uniform(-0.5, 0.5, wrong.sum())
    grid_map["elevation"] = measured
    return grid_map, heights


def stairs(riser, phase, tread=0.3):
    return lambda x, y: riser * np.floor((x - phase) / tread) + 0 * y


def ramp(degrees, direction):
    slope = np.tan(np.radians(degrees))
    return lambda x, y: slope * (x * np.cos(direction) + y * np.sin(direction))


class Stones:
    """Square stones of 0.32 m with gaps of 0.16 m, in 9 rows of 5, over a pit of 0.5 m."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.corner = random.uniform(0, RESOLUTION, 2) - (4.5 * 0.48, 2.5 * 0.48)
        self.heights = random.uniform(-0.1, 0.1, (9, 5))

    def __call__(self, x, y):
        row, u = np.divmod(x - self.corner[0], 0.48)
        column, v = np.divmod(y - self.corner[1], 0.48)
        on = (abs(u - 0.24) < 0.16) & (abs(v - 0.24) < 0.16)
        on &= (row >= 0) & (row < 9) & (column >= 0) & (column < 5)
        row, column = np.clip(row, 0, 8).astype(int), np.clip(column, 0, 4).astype(int)
        return np.where(on, self.heights[row, column], -0.5)

    def below(self, center):
        """Return the center and the height of the stone at a position."""
        cell = tuple(((np.asarray(center) - self.corner) // 0.48).astype(int))
        return self.corner + (np.array(cell) + 0.5) * 0.48, self.heights[cell]


class Rubble:
    """Turned boxes on a floor; the highest box counts."""

    def __init__(self, seed, side=4.0, count=20):
        random = np.random.default_rng(seed)
        boxes = zip(
            random.uniform(-side / 2, side / 2, (count, 2)),
            random.uniform(0.15, 0.4, (count, 2)),
            random.uniform(0, np.pi, count),
            random.uniform(0.05, 0.4, count),
            strict=True,
        )
        self.boxes = list(boxes)

    def __call__(self, x, y):
        return self.sampled(x, y)[0]

    def sampled(self, x, y):
        """Return the heights, and the number of the box at each position, 0 for the floor."""
        heights = np.zeros(np.broadcast_shapes(x.shape, y.shape))
        numbers = np.zeros(heights.shape, np.float32)
        for number, ((cx, cy), (a, b), angle, height) in enumerate(self.boxes, 1):
            u = np.cos(angle) * (x - cx) + np.sin(angle) * (y - cy)
            v = np.cos(angle) * (y - cy) - np.sin(angle) * (x - cx)
            higher = (abs(u) < a) & (abs(v) < b) & (height > heights)
            heights[higher], numbers[higher] = height, number
        return heights, numbers


def polygon(region):
    """Return the polygon of a region for Shapely."""
    from shapely import Polygon

    return Polygon(region.outer, region.holes)


def outline_of(labels, geometry, number):
    """Return the polygon through the centers of the cells with a label, from its definition.

    Four cells around a corner with the label form a square between their centers, and three form a
    triangle.
    """
    from shapely import Polygon, union_all

    x, y = geometry.axes_in_map_order()
    parts = []
    for i, j in np.ndindex(labels.shape[0] - 1, labels.shape[1] - 1):
        corners = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)]
        corners = [(x[r], y[c]) for r, c in corners if labels[r, c] == number]
        if len(corners) >= 3:
            parts.append(Polygon(corners))
    return union_all(parts)
