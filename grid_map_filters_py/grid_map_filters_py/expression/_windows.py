# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Evaluation of an expression on the sliding window around every cell."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise, product
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..errors import FilterError
from ._faults import Fault
from ._functions import SCALAR, describe
from ._interpreter import Interpreter
from ._missing import skips_missing
from ._nodes import Node
from ._window_matrices import PaddedWindow, SlidingWindow, Value, WindowMatrices, WindowMatrix

EdgeHandling = Literal["inside", "crop", "empty", "mean"]

# Cells per block: arrays of this size stay in the cache of one core.
_BLOCK = 32768

# Cells by which a window may exceed the layer; this limits memory.
_LARGEST_MARGIN = 1000

_ALGEBRA = WindowMatrices()


def evaluate_over_windows(
    root: Node,
    repeated: Collection[int],
    name: str,
    layer: NDArray[Any],
    window_size: int,
    edge_handling: EdgeHandling,
) -> NDArray[np.float32]:
    """Evaluate a syntax tree as `Expression.over_windows` does; raises Fault."""
    _check_arguments(layer, window_size, edge_handling)
    if edge_handling == "crop":
        # A window of this size covers the map from any of its cells.
        window_size = min(window_size, 2 * max(layer.shape) - 1)
    if edge_handling == "empty" or (edge_handling == "crop" and skips_missing(root, name)):
        margin = window_size // 2
        padded = np.pad(layer, margin, constant_values=np.nan)
        result = evaluate_over_windows(root, repeated, name, padded, window_size, "inside")
        inner = tuple(slice(margin, margin + length) for length in layer.shape)
        return np.asfortranarray(result[inner])
    size, margin = window_size, window_size // 2
    number = partial(_number, root, repeated, name)
    if edge_handling == "inside":
        # Without cells, so that a wrong expression fails even if no window fits.
        number(SlidingWindow(np.empty((size - 1, size - 1)), (size, size)))
    result = np.full(layer.shape, np.nan, np.float32, order="F")
    row_spans, column_spans = (_spans(length, size, edge_handling) for length in layer.shape)
    for rows, span in product(row_spans, column_spans):
        # Rectangles of cells that fit the cache and whose windows have one shape.
        for columns in span.split(max(1, _BLOCK // (rows.stop - rows.start))):
            under = layer[rows.source(margin), columns.source(margin)]
            shape = rows.last - rows.first, columns.last - columns.first
            window = SlidingWindow(np.array(under, np.float64, order="F"), shape)
            cells = slice(rows.start, rows.stop), slice(columns.start, columns.stop)
            if edge_handling == "mean" and shape != (size, size):
                corner = rows.first, columns.first
                result[cells] = number(PaddedWindow.with_mean(window, corner, (size, size)))
            else:
                result[cells] = number(window)
    return result


@dataclass(frozen=True)
class _Span:
    """Neighboring cells along one axis whose windows have the same part on the map.

    The cells are the half-open interval [start, stop), the part of the window is [first, last).
    """

    start: int
    stop: int
    first: int
    last: int

    def source(self, margin: int) -> slice:
        """Return the cells that lie under the windows."""
        return slice(self.start + self.first - margin, self.stop + self.last - margin - 1)

    def split(self, step: int) -> Iterator["_Span"]:
        """Yield parts of at most `step` cells."""
        for start in range(self.start, self.stop, step):
            yield _Span(start, min(start + step, self.stop), self.first, self.last)


def _spans(length: int, size: int, edge_handling: EdgeHandling) -> list[_Span]:
    margin = size // 2
    near = range(min(margin, length) + 1)
    cuts = sorted({*near, *(length - cell for cell in near)})
    spans = [
        _Span(start, stop, max(0, margin - start), min(size, length - stop + 1 + margin))
        for start, stop in pairwise(cuts)
    ]
    return [span for span in spans if edge_handling != "inside" or span.last - span.first == size]


def _number(root: Node, repeated: Collection[int], name: str, window: WindowMatrix) -> Any:
    """Return the value of windows: an array over their cells, or one number for all."""
    names: dict[str, Value] = {name: window}
    available = f"{name} (a window expression knows only its input layer)"
    value = Interpreter(_ALGEBRA, names, available, repeated)(root)
    shape = _ALGEBRA.shape(value)
    if shape != SCALAR:
        raise Fault(
            f"a window expression must give a single number, this one gives {describe(shape)}",
            position=root.position,
        )
    return value.at(0, 0) if isinstance(value, WindowMatrix) else value


def _check_arguments(layer: NDArray[Any], window_size: int, edge_handling: str) -> None:
    if window_size < 1 or window_size % 2 == 0:
        raise FilterError(f"the window size must be odd and positive, not {window_size}")
    if edge_handling not in get_args(EdgeHandling):
        known = ", ".join(get_args(EdgeHandling))
        raise FilterError(f"no edge handling {edge_handling!r}; available: {known}")
    if np.ndim(layer) != 2:
        raise FilterError(f"layer: expected rows and columns, got shape {np.shape(layer)}")
    if edge_handling != "crop" and window_size > max(layer.shape) + _LARGEST_MARGIN:
        raise FilterError(
            f"a window of {window_size} cells is too large for a layer of {np.shape(layer)} cells"
        )
