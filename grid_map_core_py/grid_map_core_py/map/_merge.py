# SPDX-License-Identifier: BSD-3-Clause
"""Extends maps, and copies data between maps."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .._arrays._checks import Mask, Positions, select_layers
from ..errors import GridMapError, required, short
from ._axis import BORDER_TOLERANCE
from ._geometry import GridGeometry

if TYPE_CHECKING:
    from ._grid_map import GridMap


def add_data_from(
    grid_map: GridMap,
    other: GridMap,
    *,
    extend_map: bool,
    overwrite_data: bool,
    layers: Iterable[str] | None,
) -> None:
    check_frames(grid_map, other)
    sources = {name: other[name] for name in select_layers(other, layers)}
    if extend_map:
        grid_map.extend_to_include(other)
    if not grid_map.crs:
        grid_map._reference = other._reference
    axes = grid_map.axes()
    rows, rows_inside = lines_under(axes[0], other, axis=0)
    columns, columns_inside = lines_under(axes[1], other, axis=1)
    for name, source in sources.items():
        if name not in grid_map:
            grid_map.add(name)
        # NumPy traverses the transposed arrays in memory order, which is faster.
        data, layer = source.T, grid_map[name].T
        for along_x, along_y in product(_runs(rows_inside), _runs(columns_inside)):
            values = data.take(columns[along_y], axis=0).take(rows[along_x], axis=1)
            target = layer[along_y, along_x]
            written = np.isfinite(values)
            if not overwrite_data:
                written &= ~np.isfinite(target)
            np.copyto(target, values, where=written)


def extended_map(grid_map: GridMap, other: GridMap) -> GridMap:
    """Return `grid_map` if it covers `other`, otherwise an extended copy."""
    check_frames(grid_map, other)
    inner, outer = grid_map.geometry, other.geometry
    # Far from the origin, rounding errors of coordinates exceed the usual tolerance.
    tolerance = BORDER_TOLERANCE + 4 * np.spacing(np.abs(inner.corner) + np.abs(outer.corner))
    ahead = outer.corner - inner.corner
    behind = (inner.corner - inner.length) - (outer.corner - outer.length)
    # Numbers of missing rows and columns towards +x, +y and towards -x, -y.
    before, after = (
        np.maximum(np.ceil((overhang - tolerance) / inner.resolution), 0.0)
        for overhang in (ahead, behind)
    )
    if not (before.any() or after.any()):
        return grid_map
    geometry = GridGeometry(
        grid_map.length + grid_map.resolution * (before + after),
        grid_map.resolution,
        grid_map.position + 0.5 * grid_map.resolution * (before - after),
    )
    margins = np.transpose([before, after]).astype(int)
    layers = {
        name: np.asfortranarray(np.pad(grid_map.unwrapped(name), margins, constant_values=np.nan))
        for name in grid_map
    }
    return grid_map._with(layers, geometry, (0, 0))


def check_frames(grid_map: Any, other: GridMap) -> None:
    """Raise `GridMapError` if two maps or tiled maps name different frames or reference systems."""
    if not isinstance(getattr(other, "geometry", None), GridGeometry):
        raise GridMapError(f"other: expected a map, got {short(other)}")
    frame_id = grid_map.frame_id
    if frame_id and other.frame_id and frame_id != other.frame_id:
        raise GridMapError(
            f"other: expected a map in frame {frame_id!r}, got {other.frame_id!r}. "
            f"Transform it with get_transformed_map first"
        )
    if grid_map.crs and other.crs and not _has_one_crs(grid_map, other):
        expected, got = (f"crs {short(one.crs)}, origin {one.origin}" for one in (grid_map, other))
        raise GridMapError(
            f"other: expected a map with {expected}, got {got}. Project it first, with open_map"
        )


def _has_one_crs(one: Any, other: GridMap) -> bool:
    return bool(one.origin == other.origin) and is_same_crs(one.crs, other.crs)


def is_same_crs(one: str, other: str) -> bool:
    if one == other or not one or not other:
        return one == other
    proj = required("pyproj", "comparing crs")
    try:
        return bool(proj.CRS.from_user_input(one) == proj.CRS.from_user_input(other))
    except RuntimeError:  # pyproj's CRSError is a subclass
        return False


def lines_under(
    centers: Positions, other: GridMap, axis: int
) -> tuple[npt.NDArray[np.int64], Mask]:
    """Return nearest rows (axis 0) or columns (axis 1) of `other`, and a mask of those inside."""
    positions = np.tile(other.position, (centers.size, 1))
    positions[:, axis] = centers
    lines, inside = other.get_indices(positions)
    return lines[axis], inside


def _runs(inside: Mask) -> list[slice]:
    """Return a slice for each run of True in a mask (n,)."""
    padded = np.concatenate(([False], inside, [False]))
    edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
    return [slice(first, stop) for first, stop in zip(edges[::2], edges[1::2], strict=True)]
