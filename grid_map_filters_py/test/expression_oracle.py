# SPDX-License-Identifier: BSD-3-Clause
"""Oracle of window expressions: a loop over the windows."""

import numpy as np

from grid_map_filters_py.errors import ExpressionError
from grid_map_filters_py.expression import Expression


def window_by_window(
    expression: Expression, name: str, layer: np.ndarray, window_size: int, edge_handling: str
) -> np.ndarray | None:
    """Evaluate window by window; return None if one result is not a number."""
    result = np.full(layer.shape, np.nan)
    for cell in np.ndindex(layer.shape):
        window = window_around(layer, cell, window_size, edge_handling)
        if window is None:
            continue
        try:
            value = np.asarray(expression({name: window}))
        except ExpressionError:
            return None
        if value.size != 1:
            return None
        result[cell] = value.item()
    return result


def window_around(layer, cell, window_size, edge_handling) -> np.ndarray | None:
    margin = window_size // 2
    padded = np.pad(layer, margin, constant_values=np.nan)
    on_map = np.pad(np.ones(layer.shape, bool), margin)
    place = tuple(slice(start, start + window_size) for start in cell)
    window, inside = padded[place].copy(), on_map[place]
    if inside.all():
        return window
    if edge_handling == "inside":
        return None
    if edge_handling == "crop":
        return window[np.ix_(inside.any(axis=1), inside.any(axis=0))]
    if edge_handling == "mean":
        finite = window[np.isfinite(window)].astype(np.float64)
        window[~inside] = finite.mean() if finite.size else np.nan
    return window
