# SPDX-License-Identifier: BSD-3-Clause
"""Growing a map, and copying data of another map into it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._arrays._checks import Mask, Positions, select_layers
from ..errors import GridMapError, short
from ._axis import BORDER_TOLERANCE
from ._geometry import GridGeometry

if TYPE_CHECKING:
    from ..tiled._source import TiledData
    from ._grid_map import GridMap

_BLOCK = 1 << 15  # number of cells copied at a time, which fit into the cache


def add_data_from(
    grid_map: GridMap,
    other: GridMap,
    *,
    extend_map: bool,
    overwrite_data: bool,
    layers: Iterable[str] | None,
) -> None:
    """Copy data of `other` into `grid_map`; see `GridMap.add_data_from`."""
    check_frames(grid_map, other)
    sources = {name: other[name] for name in select_layers(other, layers)}
    if extend_map:
        grid_map.extend_to_include(other)
    axes = grid_map.axes()
    rows, rows_inside = lines_under(axes[0], other, axis=0)
    columns, columns_inside = lines_under(axes[1], other, axis=1)
    for name, source in sources.items():
        if name not in grid_map:
            grid_map.add(name)
        for block in _blocks(rows_inside, columns_inside):
            # Column after column, as layers are stored: one index is faster than two.
            cells = columns[block[1], None] * source.shape[0] + rows[block[0]]
            values, target = source.ravel("F")[cells], grid_map[name][block].T
            written = np.isfinite(values)
            if not overwrite_data:
                written &= ~np.isfinite(target)
            np.copyto(target, values, where=written)


def extended_map(grid_map: GridMap, other: GridMap) -> GridMap:
    """Return a map that covers `other` as well; `grid_map` itself if it covers it already."""
    check_frames(grid_map, other)
    inner, outer = grid_map.geometry, other.geometry
    # Far from the origin, coordinates are less precise than the usual tolerance.
    tolerance = BORDER_TOLERANCE + 4 * np.spacing(np.abs(inner.corner) + np.abs(outer.corner))
    ahead = outer.corner - inner.corner
    behind = (inner.corner - inner.length) - (outer.corner - outer.length)
    # Rows and columns that are missing towards +x, +y and towards -x, -y.
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


def check_frames(grid_map: GridMap | TiledData, other: GridMap) -> None:
    """Raise `GridMapError` unless `other` is a map in the frame of `grid_map`."""
    if not isinstance(getattr(other, "geometry", None), GridGeometry):
        raise GridMapError(f"other: expected a map, got {short(other)}")
    if grid_map.frame_id and other.frame_id and grid_map.frame_id != other.frame_id:
        raise GridMapError(
            f"other: expected a map in frame {grid_map.frame_id!r}, got {other.frame_id!r}. "
            f"Transform it with get_transformed_map first"
        )


def lines_under(
    centers: Positions, other: GridMap, axis: int
) -> tuple[npt.NDArray[np.int64], Mask]:
    """Return the row (axis 0) or column (axis 1) of `other` under each one of another grid.

    Both grids are parallel, so that this does not depend on the other axis.

    Args:
        centers: (N,) x of the rows, or y of the columns, of the other grid [m].
        other: the map that lies under it.
        axis: 0 for rows, 1 for columns.

    Returns:
        lines: (N,) buffer indices of `other`.
        inside: (N,) whether the centers are on `other` along this axis.
    """
    positions = np.tile(other.position, (centers.size, 1))
    positions[:, axis] = centers
    lines, inside = other.get_indices(positions)
    return lines[axis], inside


def _blocks(rows_inside: Mask, columns_inside: Mask) -> Iterator[tuple[slice, slice]]:
    """Yield blocks that cover the cells inside and fit into the cache."""
    for rows in _runs(rows_inside):
        step = max(1, _BLOCK // (rows.stop - rows.start))
        for columns in _runs(columns_inside):
            for first in range(columns.start, columns.stop, step):
                yield rows, slice(first, min(first + step, columns.stop))


def _runs(inside: Mask) -> list[slice]:
    """Return the slices in which a mask is True; two if the run wraps around the buffer."""
    padded = np.concatenate(([False], inside, [False]))
    edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
    return [slice(first, stop) for first, stop in zip(edges[::2], edges[1::2], strict=True)]
