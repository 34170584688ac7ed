# SPDX-License-Identifier: BSD-3-Clause
"""Costs for the node `costmap`: float32 layers of whole values from 0 to 254, NaN for unknown."""

import itertools
import math

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap, GridMapError
from grid_map_core_py.conversions import CostRange
from grid_map_core_py.conversions._costmap import LETHAL, UNKNOWN
from grid_map_core_py.limits import check_cells

from .messages._fields import Matrix

TOLERANCE = 1e-6
"""Cells touch if they overlap by more than this [cells]."""

Planar = tuple[float, float, float]
"""Pose of a frame in another frame: x, y [m] and yaw [rad]."""


def planar(matrix: Matrix, source: str, target: str) -> Planar:
    """Return the planar part of a (4, 4) transform; reject roll or pitch above 5 degrees."""
    roll = math.degrees(math.atan2(matrix[2, 1], matrix[2, 2]))
    pitch = math.degrees(math.asin(np.clip(-matrix[2, 0], -1.0, 1.0)))
    if max(abs(roll), abs(pitch)) > 5.0:
        raise GridMapError(
            f"frame {source!r}: expected roll and pitch of at most 5 deg in {target!r}, got "
            f"{roll:.1f} and {pitch:.1f} deg. Choose another frame_id"
        )
    return matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])


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
    """Return the largest part of a map with borders at multiples of `step` cells from (0, 0)."""
    if step == 1:
        return grid_map
    slices = []
    lower = (grid_map.position - 0.5 * grid_map.length) / grid_map.resolution
    # `lower` is usually a multiple of 1/2; with 1/4 added, rounding errors do not change its floor.
    for begin, size in zip(np.floor(lower + 0.25).astype(int), grid_map.size, strict=True):
        first, end = -(-begin // step) * step - begin, (begin + size) // step * step - begin
        if end <= first:
            raise GridMapError(
                f"origin_grid: expected {step} x {step} aligned cells inside the map, got a map "
                f"of {grid_map.size[0]} x {grid_map.size[1]} cells. Choose a smaller origin_grid"
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
    unknown_is_worst: bool = True,
) -> GridMap:
    """Return costs in another frame or resolution, on a grid aligned with the frame origin.

    Each cell gets the worst cost of the map cells that it touches; if it touches none, it becomes
    unknown. If `unknown_is_worst`, unknown is worse than all costs, otherwise only worse than free.

    Args:
        grid_map, layer: the costs.
        transform: pose of the map's frame in the frame `frame_id`.
        frame_id, resolution: frame and cell size [m] of the result.
    """
    (*shift, yaw), source = transform, grid_map.resolution
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn = np.array([[cos, -sin], [sin, cos]])
    center, half = turn @ grid_map.position + shift, np.abs(turn) @ (0.5 * grid_map.length)
    lower = np.floor((center - half) / resolution + TOLERANCE)
    upper = np.ceil((center + half) / resolution - TOLERANCE)
    size = int(upper[0] - lower[0]), int(upper[1] - lower[1])
    check_cells("resolution", size)
    geometry = GridGeometry.from_size(size, resolution, 0.5 * resolution * (lower + upper))
    x = resolution * (lower[0] + 0.5 + np.arange(size[0]))[:, None] - center[0]
    y = resolution * (lower[1] + 0.5 + np.arange(size[1])) - center[1]
    # Centers of the new cells relative to the center of the first source cell [source cells].
    u = (cos * x + sin * y) / source + 0.5 * (grid_map.size[0] - 1)
    v = (cos * y - sin * x) / source + 0.5 * (grid_map.size[1] - 1)
    # Rank 0 means that no cell is touched; rank 2, between costs 0 and 1, is kept for unknown.
    ranks = np.array([1, *range(3, 257)] + [257 if unknown_is_worst else 2], np.int16)
    values = np.full(258, np.nan, np.float32)
    values[ranks[:UNKNOWN]] = np.arange(UNKNOWN)
    costs = CostRange().to_costs(grid_map.unwrapped(layer))[::-1, ::-1]
    worst = _worst(ranks[costs], u, v, (cos, sin), resolution / source)[::-1, ::-1]
    result = GridMap.from_geometry(geometry, frame_id=frame_id, timestamp=grid_map.timestamp)
    return result.with_layers({layer: values[worst]})


def _worst(
    ranks: npt.NDArray[np.int16],
    u: npt.NDArray[np.float64],
    v: npt.NDArray[np.float64],
    direction: tuple[float, float],
    side: float,
) -> npt.NDArray[np.int16]:
    """For each square, return the largest rank of the unit squares that it touches, or 0.

    Unit square (i, j) has its center at i, j and the rank `ranks[i, j]`. The other squares have
    centers (u, v), each (n, m), and side `side`. They are rotated by an angle; `direction` is its
    cosine and sine. Two squares touch unless their projections on one of the four directions of
    the sides are disjoint. Each iteration tests one of the few possible neighbors of all squares.
    """
    (cos, sin), extent = direction, abs(direction[0]) + abs(direction[1])
    reach, turned_reach = 0.5 * (1 + side * extent) - TOLERANCE, 0.5 * (side + extent) - TOLERANCE
    padded, near = np.pad(ranks, 1), (np.rint(u), np.rint(v))
    # Differences are at most a few cells, and need fewer digits than positions.
    du, dv = (near[0] - u).astype(np.float32), (near[1] - v).astype(np.float32)
    neighbors = range(-int(reach + 0.5), int(reach + 0.5) + 1)
    rows, columns = (
        {k: np.clip(cells + (k + 1), 0, count + 1).astype(np.intp) for k in neighbors}
        for cells, count in zip(near, ranks.shape, strict=True)
    )
    worst = np.zeros(u.shape, np.int16)
    for i, j in itertools.product(neighbors, repeat=2):
        x, y = du + np.float32(i), dv + np.float32(j)
        touches = (np.abs(x) < reach) & (np.abs(y) < reach)
        touches &= np.abs(cos * x - sin * y) < turned_reach
        touches &= np.abs(sin * x + cos * y) < turned_reach
        np.maximum(worst, padded[rows[i], columns[j]] * touches, out=worst)
    return worst
