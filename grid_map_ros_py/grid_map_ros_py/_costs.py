# SPDX-License-Identifier: BSD-3-Clause
"""Cost layers (whole numbers from 0 to 254, or NaN) for the `costmap` node."""

import itertools
import math

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap, GridMapError
from grid_map_core_py.conversions import CostRange
from grid_map_core_py.conversions._costmap import FREE, LETHAL, UNKNOWN
from grid_map_core_py.limits import check_cells

from .errors import TiltedFrameError
from .messages._fields import Matrix

TOLERANCE = 1e-3
"""Minimum overlap of two cells that touch [cells]; smaller overlaps may be rounding errors."""

WORST_BELOW_UNKNOWN = {"worst": LETHAL, "above_free": FREE}
"""Largest cost that an unknown cell hides, by the value of the parameter `unknown`."""

Planar = tuple[float, float, float]
"""Pose of a frame in another frame: x, y [m] and yaw [rad]."""


def planar(matrix: Matrix, source: str, target: str) -> Planar:
    """Return x, y and yaw of a (4, 4) transform that is tilted by at most 5 degrees."""
    roll = math.degrees(math.atan2(matrix[2, 1], matrix[2, 2]))
    pitch = math.degrees(math.asin(np.clip(-matrix[2, 0], -1.0, 1.0)))
    if max(abs(roll), abs(pitch)) > 5.0:
        raise TiltedFrameError(
            f"frame {source!r}: expected roll and pitch of at most 5 deg in {target!r}, got "
            f"{roll:.1f} and {pitch:.1f} deg. Choose another frame_id"
        )
    return matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])


def check_costs(grid_map: GridMap, layer: str) -> None:
    """Raise `GridMapError` unless each value is NaN or a whole number from 0 to 254."""
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
    """Crop a map so that its borders are multiples of `step` cells away from the frame origin."""
    if step == 1:
        return grid_map
    slices = []
    lower = (grid_map.position - 0.5 * grid_map.length) / grid_map.resolution
    # `lower` is usually a multiple of 1/2. Adding 1/4 makes its floor robust to rounding errors.
    for begin, size in zip(np.floor(lower + 0.25).astype(int), grid_map.size, strict=True):
        first, end = -(-begin // step) * step - begin, (begin + size) // step * step - begin
        if end <= first:
            raise GridMapError(
                f"origin_grid: expected {step} x {step} aligned cells inside the map, got a map "
                f"of {grid_map.size[0]} x {grid_map.size[1]} cells. Choose a smaller origin_grid"
            )
        # Row 0 and column 0 of a map have the largest x and y.
        slices.append(slice(size - end, size - first))
    return grid_map.get_block(*slices)


def resampled(
    grid_map: GridMap,
    layer: str,
    transform: Planar,
    frame_id: str,
    resolution: float,
    worst_below_unknown: int = LETHAL,
) -> GridMap:
    """Resample costs to another frame or resolution, on a grid aligned with the frame origin.

    Each new cell gets the worst cost of the map cells that it touches. A new cell that touches no
    map cell becomes unknown.

    Args:
        transform: pose of the map's frame in the frame `frame_id`.
        worst_below_unknown: costs up to this value are better than an unknown cell.
    """
    (*shift, yaw), source = transform, grid_map.resolution
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn = np.array([[cos, -sin], [sin, cos]])
    center, half = turn @ grid_map.position + shift, np.abs(turn) @ (0.5 * grid_map.length)
    # Large cells are divided into parts of about the size of a map cell.
    parts = max(1, round(resolution / source))
    side = resolution / parts
    offset = (center - half) / side
    is_aligned = np.abs(offset - np.rint(offset)).max() < TOLERANCE
    if is_aligned and (frame_id, resolution) == (grid_map.frame_id, source):
        return grid_map
    lower = np.floor(offset + TOLERANCE).astype(int)
    upper = np.ceil((center + half) / side - TOLERANCE).astype(int)
    first, end = lower // parts, -(-upper // parts)
    size = int(end[0] - first[0]), int(end[1] - first[1])
    check_cells("resolution", size)
    geometry = GridGeometry.from_size(size, resolution, 0.5 * resolution * (first + end))
    x = side * (np.arange(lower[0], upper[0]) + 0.5)[:, None] - center[0]
    y = side * (np.arange(lower[1], upper[1]) + 0.5) - center[1]
    # Centers of the new cells, relative to the center of the first source cell [source cells].
    u = (cos * x + sin * y) / source + 0.5 * (grid_map.size[0] - 1)
    v = (cos * y - sin * x) / source + 0.5 * (grid_map.size[1] - 1)
    # Costs have the ranks 2, 4, 6, ...; rank 0 means that no cell is touched.
    ranks = (2 * np.arange(UNKNOWN + 1) + 2).astype(np.int16)
    ranks[UNKNOWN] = ranks[worst_below_unknown] + 1
    values = np.full(ranks.max() + 1, np.nan, np.float32)
    values[ranks[:UNKNOWN]] = np.arange(UNKNOWN)
    costs = CostRange().to_costs(grid_map.unwrapped(layer))[::-1, ::-1]
    worst = _worst(ranks[costs], u, v, (cos, sin), side / source)
    for axis in (0, 1):
        starts = np.arange(first[axis], end[axis]) * parts - lower[axis]
        worst = np.maximum.reduceat(worst, np.maximum(starts, 0), axis)
    result = GridMap.from_geometry(geometry, frame_id=frame_id, timestamp=grid_map.timestamp)
    return result.with_layers({layer: values[worst[::-1, ::-1]]})


def _worst(
    ranks: npt.NDArray[np.int16],
    u: npt.NDArray[np.float64],
    v: npt.NDArray[np.float64],
    direction: tuple[float, float],
    side: float,
) -> npt.NDArray[np.int16]:
    """Return the highest rank of the cells that each rotated square touches; 0 if none.

    The cell with the rank `ranks[i, j]` is a unit square with its center at (i, j). The rotated
    squares have the side length `side`, the centers `u`, `v` (n, m), and the rotation (cosine,
    sine) `direction`. Contact is tested with the separating axis theorem.
    """
    if direction == (1.0, 0.0):
        return _worst_along(_worst_along(ranks, u[:, 0], side).T, v[0], side).T
    (cos, sin), extent = direction, abs(direction[0]) + abs(direction[1])
    reach, turned_reach = 0.5 * (1 + side * extent) - TOLERANCE, 0.5 * (side + extent) - TOLERANCE
    padded, near = np.pad(ranks, 1), (np.rint(u), np.rint(v))
    # Single precision is sufficient, because the differences are at most a few cells.
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


def _worst_along(
    ranks: npt.NDArray[np.int16], centers: npt.NDArray[np.float64], side: float
) -> npt.NDArray[np.int16]:
    """Return, for each interval, the elementwise maximum of the rows of `ranks` that it touches.

    Row i covers i - 0.5 to i + 0.5. The intervals have the length `side` and the centers `centers`.
    """
    reach = 0.5 * (1 + side) - TOLERANCE
    ends = np.stack([np.ceil(centers - reach), np.floor(centers + reach)])
    first, last = np.clip(ends, 0, len(ranks) - 1).astype(np.intp)
    worst: npt.NDArray[np.int16] = ranks[first]
    for k in range(1, np.max(last - first) + 1):
        np.maximum(worst, ranks[np.minimum(first + k, last)], out=worst)
    return worst
