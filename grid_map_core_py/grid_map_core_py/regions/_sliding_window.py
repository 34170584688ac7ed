# SPDX-License-Identifier: BSD-3-Clause
"""Sliding windows: the square of cells around each cell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import Literal, TypeAlias, get_args

import numpy as np

from .._arrays._checks import Layer, Size, as_finite
from ..errors import GeometryError, GridMapError, short
from ..map._grid_map import GridMap

EdgeHandling: TypeAlias = Literal["inside", "crop", "empty", "mean"]
"""Handling of windows that extend beyond the map; see `sliding_windows`."""


def sliding_windows(
    grid_map: GridMap,
    layer: str,
    edge_handling: EdgeHandling = "crop",
    window_size: int | None = None,
    *,
    window_length: float | None = None,
) -> Iterator[tuple[Size, Layer]]:
    """Return an iterator over the windows around all cells, in the order of `map_cells`.

    Each item is the buffer index (row, column) of a cell and the window around this cell. The
    window is a read-only float32 array in map order. Later changes to the layer have no effect.

    Args:
        layer: name of the layer.
        edge_handling: handling of windows that extend beyond the map. "inside" skips them. "crop"
            crops them. "empty" pads them with NaN. "mean" pads them with the mean of their finite
            values.
        window_size: side of the window [cells], odd.
        window_length: side of the window [m], instead of `window_size`. It is rounded to whole
            cells. An even number of cells is increased by 1.
    """
    _check_edge_handling(edge_handling, get_args(EdgeHandling))
    size = _window_cells(grid_map.resolution, window_size, window_length)
    if edge_handling in ("inside", "crop"):
        # A larger window would contain no more cells, but its margin would use more memory.
        size = min(size, 2 * max(grid_map.size) + 1)
    padded = _padded(grid_map.unwrapped(layer), size // 2)
    return _windows(padded, grid_map.start_index, grid_map.size, edge_handling, size)


def window_array(
    grid_map: GridMap,
    layer: str,
    edge_handling: EdgeHandling = "empty",
    window_size: int | None = None,
    *,
    window_length: float | None = None,
) -> Layer:
    """Return the windows around all cells as one array in map order.

    `np.nanmedian(window_array(grid_map, "elevation", "empty", 3), axis=(2, 3))` is a median filter.
    The arguments are those of `sliding_windows`, except that "crop" is invalid.

    Returns:
        (rows, cols, size, size) float32, read-only. With "inside", the shape is (rows - size + 1,
        cols - size + 1, size, size). With "inside" and "empty", the windows are views of one copy
        of the layer. With "mean", every window is stored separately, which needs more memory.
    """
    _check_edge_handling(edge_handling, ("inside", "empty", "mean"))
    size = _window_cells(grid_map.resolution, window_size, window_length)
    margin = 0 if edge_handling == "inside" else size // 2
    windows = _view(_padded(grid_map.unwrapped(layer), margin), size)
    if edge_handling != "mean":
        return windows
    beyond = _view(_padded(np.zeros(grid_map.size, dtype=np.float32), margin), size)
    filled = windows.copy()
    # Row by row, so that temporary arrays are small compared to the result.
    for row, outside in zip(filled, beyond, strict=True):
        np.copyto(row, _finite_means(row)[:, None, None], where=np.isnan(outside))
    filled.flags.writeable = False
    return filled


def _check_edge_handling(edge_handling: object, known: tuple[str, ...]) -> None:
    if edge_handling not in known:
        raise GridMapError(
            f"edge_handling: expected one of {', '.join(known)}, got {short(edge_handling)}"
        )


def _window_cells(resolution: float, size: int | None, length: float | None) -> int:
    if (size is None) == (length is None):
        raise GeometryError(
            f"window_size, window_length: expected one of them, got {size!r} and {length!r}"
        )
    if length is not None:
        meters = as_finite(length, "window_length", "a length > 0 [m]", above=0.0)
        cells = math.floor(meters / resolution + 0.5)
        return cells if cells % 2 else cells + 1
    if not isinstance(size, int | np.integer) or size < 1 or size % 2 == 0:
        raise GeometryError(f"window_size: expected an odd number of cells, got {short(size)}")
    return int(size)


def _windows(
    padded: Layer, start: Size, shape: Size, edge_handling: EdgeHandling, size: int
) -> Iterator[tuple[Size, Layer]]:
    """Yield the buffer index and window of each cell; `padded` is in map order in a NaN margin."""
    margin = size // 2
    for column, row in product(range(shape[1]), range(shape[0])):
        first = (row - start[0]) % shape[0], (column - start[1]) % shape[1]
        window = padded[tuple(slice(n, n + size) for n in first)]
        on_map = tuple(
            slice(max(margin - n, 0), count + margin - n)
            for n, count in zip(first, shape, strict=True)
        )
        cropped = window[on_map]
        if edge_handling == "crop":
            window = cropped
        elif cropped.shape != window.shape:
            if edge_handling == "inside":
                continue
            if edge_handling == "mean":
                filled = np.full(window.shape, _finite_means(window[None])[0])
                filled[on_map] = cropped
                filled.flags.writeable = False
                window = filled
        yield (row, column), window


def _view(data: Layer, size: int) -> Layer:
    """Return all windows of `data` as a view (rows - size + 1, cols - size + 1, size, size)."""
    if min(data.shape) < size:
        rows, columns = (max(side - size + 1, 0) for side in data.shape)
        return np.empty((rows, columns, size, size), dtype=np.float32)
    return np.lib.stride_tricks.sliding_window_view(data, (size, size))


def _padded(data: Layer, margin: int) -> Layer:
    rows, columns = data.shape
    padded: Layer = np.full((rows + 2 * margin, columns + 2 * margin), np.nan, np.float32, "F")
    padded[margin : margin + rows, margin : margin + columns] = data
    padded.flags.writeable = False
    return padded


def _finite_means(windows: Layer) -> Layer:
    finite = np.isfinite(windows)
    total = np.sum(windows, axis=(1, 2), dtype=np.float64, where=finite)
    with np.errstate(invalid="ignore"):
        means = total / np.count_nonzero(finite, axis=(1, 2))
    return np.asarray(means, dtype=np.float32)
