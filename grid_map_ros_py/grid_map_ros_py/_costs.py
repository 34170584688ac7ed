# SPDX-License-Identifier: BSD-3-Clause
"""Costs to send: checks, the transform to another frame, and aligned windows.

Costs are a float32 layer with whole values from 0 to 254; NaN is unknown.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap, GridMapError
from grid_map_core_py.conversions import CostRange
from grid_map_core_py.conversions._costmap import LETHAL, UNKNOWN
from grid_map_core_py.limits import check_cells

from .messages._fields import Matrix

LARGEST_TILT = math.radians(5.0)
"""Largest roll or pitch between two frames whose costs are taken as the same plane [rad]."""

TOLERANCE = 1e-6
"""Overlap below which two cells do not touch [cells]."""

UNTOUCHED = 0
"""Rank of a target cell that touches no source cell; below the ranks of all costs."""


class Planar(NamedTuple):
    """Planar transform: position x, y [m] and yaw [rad] of the source frame."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0


def planar(matrix: Matrix, source: str, target: str) -> Planar:
    """Return the planar part of a (4, 4) transform from the frame `source` to `target`.

    Raises:
        GridMapError: roll or pitch exceeds 5 degrees.
    """
    roll = math.atan2(matrix[2, 1], matrix[2, 2])
    pitch = math.asin(max(-1.0, min(1.0, -matrix[2, 0])))
    if max(abs(roll), abs(pitch)) > LARGEST_TILT:
        found = f"{math.degrees(roll):.1f} and {math.degrees(pitch):.1f}"
        raise GridMapError(
            f"frame {source!r}: expected roll and pitch of at most 5 deg in {target!r}, got "
            f"{found} deg. Choose a frame_id whose z axis is parallel"
        )
    return Planar(matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0]))


def check_costs(grid_map: GridMap, layer: str) -> None:
    """Raise `GridMapError` unless all values of a layer are whole costs or NaN."""
    values = grid_map[layer]
    with np.errstate(invalid="ignore"):
        whole = values.astype(np.uint8)
    wrong = ((values != whole) | (whole > LETHAL)) & ~np.isnan(values)
    if wrong.any():
        raise GridMapError(
            f"layer {layer!r}: expected whole costs from 0 to {LETHAL} or NaN, got "
            f"{values[wrong][0]:g}. Compute costs with gridMapFilters/CostFilter"
        )


def aligned(grid_map: GridMap, step: int) -> GridMap:
    """Return the largest window of a map whose borders are multiples of `step` cells.

    Cells are counted from the origin of the frame, so that the windows of a map that moves by less
    than `step` cells coincide.
    """
    if step == 1:
        return grid_map
    slices = []
    lower = (grid_map.position - 0.5 * grid_map.length) / grid_map.resolution
    for begin, size in zip(lower.tolist(), grid_map.size, strict=True):
        # Cell centers may lie at any fraction of a cell; a quarter is far from 0 and 1/2.
        begin = math.floor(begin + 0.25)
        first, end = -(-begin // step) * step - begin, (begin + size) // step * step - begin
        if end <= first:
            raise GridMapError(
                f"origin_grid: expected a window of {step} x {step} cells inside the map, got a "
                f"map of {grid_map.size[0]} x {grid_map.size[1]} cells. Choose a smaller origin_grid"
            )
        # A map begins at the largest x and y.
        slices.append(slice(size - end, size - first))
    return grid_map.get_block(*slices)


def resampled(
    grid_map: GridMap,
    layer: str,
    transform: Planar,
    frame_id: str,
    resolution: float,
    *,
    unknown_is_worst: bool = True,
) -> GridMap:
    """Return costs in another frame or resolution, on a grid aligned with the frame's origin.

    Each cell gets the worst cost of the source cells that it touches. Cells that touch no source
    cell are unknown.

    Args:
        grid_map: the source.
        layer: name of the layer to convert.
        transform: pose of the source frame in the target frame.
        frame_id: target frame.
        resolution: cell size of the result [m].
        unknown_is_worst: unknown is worse than all costs; otherwise, only worse than free.
    """
    cos, sin = math.cos(transform.yaw), math.sin(transform.yaw)
    turn, shift = np.array([[cos, -sin], [sin, cos]]), np.array(transform[:2])
    half = 0.5 * grid_map.length @ np.abs(turn).T
    center = turn @ grid_map.position + shift
    lower = np.floor((center - half) / resolution + TOLERANCE)
    upper = np.ceil((center + half) / resolution - TOLERANCE)
    size = int(upper[0] - lower[0]), int(upper[1] - lower[1])
    check_cells("resolution", size)
    geometry = GridGeometry.from_size(size, resolution, 0.5 * resolution * (lower + upper))
    x, y = (
        resolution * (begin + 0.5 + np.arange(count)) - offset
        for begin, count, offset in zip(lower, size, center, strict=True)
    )
    # Centers of the target cells in the source, in cells from the center of the first cell.
    first = 0.5 * (np.array(grid_map.size) - 1)
    u = (cos * x[:, None] + sin * y) / grid_map.resolution + first[0]
    v = (cos * y - sin * x[:, None]) / grid_map.resolution + first[1]
    ranks = np.arange(256, dtype=np.int16) + 2
    ranks[0] = 1
    ranks[UNKNOWN] = 257 if unknown_is_worst else 2
    costs = CostRange().to_costs(grid_map.unwrapped(layer))[::-1, ::-1]
    worst = _worst(ranks[costs], u, v, cos, sin, resolution / grid_map.resolution)
    values = np.full(258, np.nan, np.float32)
    values[ranks[:UNKNOWN]] = np.arange(UNKNOWN)
    return GridMap.from_geometry(
        geometry, frame_id=frame_id, timestamp=grid_map.timestamp
    ).with_layers({layer: values[worst[::-1, ::-1]]})


def _worst(
    ranks: npt.NDArray[np.int16],
    u: npt.NDArray[np.float64],
    v: npt.NDArray[np.float64],
    cos: float,
    sin: float,
    side: float,
) -> npt.NDArray[np.int16]:
    """Return the largest rank of the source cells that each target cell touches.

    Two squares touch unless one of the four directions of their sides separates them. The loop
    runs over the few neighbors that can touch a cell, for all cells at once.

    Args:
        ranks: (rows, cols) ranks of the source cells.
        u, v: (n, m) centers of the target cells [source cells].
        cos, sin: direction of the source's axes in the target frame.
        side: side of a target cell [source cells].
    """
    extent = abs(cos) + abs(sin)
    reach = 0.5 * (1 + side * extent) - TOLERANCE
    turned_reach = 0.5 * (side + extent) - TOLERANCE
    padded = np.pad(ranks, 1, constant_values=UNTOUCHED)
    near = np.rint(u), np.rint(v)
    # Differences are at most a few cells, and need fewer digits than positions.
    du, dv = (near[0] - u).astype(np.float32), (near[1] - v).astype(np.float32)
    neighbors = range(-int(reach + 0.5), int(reach + 0.5) + 1)
    rows, columns = (
        {k: np.clip(cells + (k + 1), 0, count + 1).astype(np.intp) for k in neighbors}
        for cells, count in zip(near, ranks.shape, strict=True)
    )
    worst = np.full(u.shape, UNTOUCHED, np.int16)
    for i, j in itertools.product(neighbors, repeat=2):
        x, y = du + np.float32(i), dv + np.float32(j)
        touches = (np.abs(x) < reach) & (np.abs(y) < reach)
        touches &= np.abs(cos * x - sin * y) < turned_reach
        touches &= np.abs(sin * x + cos * y) < turned_reach
        np.maximum(worst, padded[rows[i], columns[j]] * touches, out=worst)
    return worst
