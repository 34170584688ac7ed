# SPDX-License-Identifier: BSD-3-Clause
"""Places boxes, ramps and stairs on a terrain."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import as_finite, as_pair
from ..map import GridMap
from ..regions import polygon_cells

_Profile: TypeAlias = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Function that returns the relative height (0 to 1) at positions along the x axis (0 to 1)."""


def with_box(
    grid_map: GridMap,
    center: ArrayLike,
    length: ArrayLike,
    height: float,
    *,
    yaw: float = 0.0,
    layer: str = "elevation",
) -> GridMap:
    """Return a map with a box on the ground.

    The object covers all cells whose centers lie in its outline, even cells without a height.
    Ground higher than the object stays unchanged.

    Args:
        grid_map: the terrain, which stays unchanged.
        center: (2,) center of the object [m], map frame; parts outside the map are cut off.
        length: (2,) side lengths along the object's x and y axes [m].
        height: height of the object [m] above the mean height of the ground below it, or above 0 if
            the ground is unknown.
        yaw: rotation of the object relative to the map [rad].
        layer: name of the height layer.

    Raises:
        GeometryError: an argument is not finite.
        LayerNotFoundError: the map has no such layer.
    """
    return _with_object(grid_map, center, length, height, yaw, layer, np.ones_like)


def with_ramp(
    grid_map: GridMap,
    center: ArrayLike,
    length: ArrayLike,
    height: float,
    *,
    yaw: float = 0.0,
    layer: str = "elevation",
) -> GridMap:
    """Return a map with a ramp that rises to `height` along its own x axis; see `with_box`."""
    return _with_object(grid_map, center, length, height, yaw, layer, lambda share: share)


def with_stairs(
    grid_map: GridMap,
    center: ArrayLike,
    length: ArrayLike,
    height: float,
    steps: int,
    *,
    yaw: float = 0.0,
    layer: str = "elevation",
) -> GridMap:
    """Return a map with stairs that rise in equal steps along their own x axis; see `with_box`."""
    count = as_finite(steps, "steps", "a number of steps", least=1.0)

    def profile(share: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.minimum(np.floor(share * count) + 1.0, count) / count

    return _with_object(grid_map, center, length, height, yaw, layer, profile)


def _with_object(
    grid_map: GridMap,
    center: ArrayLike,
    length: ArrayLike,
    height: float,
    yaw: float,
    layer: str,
    profile: _Profile,
) -> GridMap:
    middle, sides = np.array(as_pair(center, "center")), np.array(as_pair(length, "length"))
    height, yaw = as_finite(height, "height"), as_finite(yaw, "yaw")
    x_axis = np.array([np.cos(yaw), np.sin(yaw)])
    axes = np.array([x_axis, (-x_axis[1], x_axis[0])])
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    cells = polygon_cells(grid_map, middle + corners * sides @ axes)
    heights = grid_map[layer].copy("K")
    if cells[0].size:
        ground = heights[cells]
        known = ground[np.isfinite(ground)]
        base = float(known.mean(dtype=np.float64)) if known.size else 0.0
        along = (grid_map.get_positions(cells) - middle) @ x_axis
        share = np.clip(along / sides[0] + 0.5, 0.0, 1.0)
        heights[cells] = np.fmax(ground, base + height * profile(share))
    return grid_map.with_layers({layer: heights})
