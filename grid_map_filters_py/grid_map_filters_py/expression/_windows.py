# SPDX-License-Identifier: BSD-3-Clause
"""Evaluates an expression on the sliding window around every cell."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise, product
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from grid_map_core_py.regions._sliding_window import EdgeHandling

from ..errors import FilterError
from ._functions import COMPARISONS, CONSTANTS, FUNCTIONS, POWERS
from ._interpreter import Interpreter
from ._matrices import SCALAR, describe, shape_of
from ._nodes import Fault, Node
from ._window_matrices import SlidingWindow, WindowMatrices, WindowMatrix, mean_padded_window

# Number of cells per block; arrays of this size fit into the cache of one core.
_BLOCK = 2**17

# Maximum number of cells by which a window may exceed the layer, to limit memory.
_LARGEST_MARGIN = 1000


def evaluate_over_windows(
    root: Node, name: str, layer: NDArray[Any], window_size: int, edge_handling: EdgeHandling
) -> NDArray[np.float32]:
    """Evaluate a syntax tree like `Expression.over_windows`; errors are Faults."""
    _check_arguments(layer, window_size, edge_handling)
    if edge_handling == "crop":
        # A window of this size covers the whole map from any cell.
        window_size = min(window_size, 2 * max(layer.shape) - 1)
    size, margin = window_size, window_size // 2
    if edge_handling == "empty" or (edge_handling == "crop" and skips_missing(root, name)):
        padded = np.pad(layer, margin, constant_values=np.nan)
        result = evaluate_over_windows(root, name, padded, size, "inside")
        inner = tuple(slice(margin, margin + length) for length in layer.shape)
        return np.asfortranarray(result[inner])
    number = partial(_number, root, name)
    if edge_handling == "mean":
        result = evaluate_over_windows(root, name, layer, size, "inside")
        border = np.ones(layer.shape, np.bool_)
        border[tuple(slice(margin, max(margin, length - margin)) for length in layer.shape)] = False
        result.T[border.T] = number(mean_padded_window(layer, border, size))
        return result
    if edge_handling == "inside":
        # Evaluate the expression for zero windows, to find errors even if no window fits.
        number(SlidingWindow(np.empty((size - 1, size - 1)), (size, size)))
    result = np.full(layer.shape, np.nan, np.float32, order="F")
    row_spans, column_spans = (_spans(length, size, edge_handling) for length in layer.shape)
    for rows, span in product(row_spans, column_spans):
        # Each block of cells fits into the cache, and its windows have the same shape.
        for columns in span.split(max(1, _BLOCK // (rows.stop - rows.start))):
            values = np.array(layer[rows.source, columns.source], np.float64, order="F")
            window = SlidingWindow(values, (rows.window, columns.window))
            result[rows.start : rows.stop, columns.start : columns.stop] = number(window)
    return result


class _Span(NamedTuple):
    """Consecutive cells [`start`, `stop`) whose windows are cropped in the same way.

    Each cropped window has `window` cells. The first window begins at the cell `first`.
    """

    start: int
    stop: int
    first: int
    window: int

    @property
    def source(self) -> slice:
        """Cells covered by the windows."""
        return slice(self.first, self.first + self.stop - self.start + self.window - 1)

    def split(self, step: int) -> Iterator["_Span"]:
        """Split the span into parts of at most `step` cells."""
        for start in range(self.start, self.stop, step):
            first = self.first + start - self.start
            yield _Span(start, min(start + step, self.stop), first, self.window)


def _spans(length: int, size: int, edge_handling: EdgeHandling) -> list[_Span]:
    margin = size // 2
    near = range(min(margin, length) + 1)
    spans = []
    for start, stop in pairwise(sorted({*near, *(length - cell for cell in near)})):
        # Window of the cell `start`; all windows of a span are cropped in the same way.
        first, last = max(0, start - margin), start + min(size - margin, length - stop + 1)
        spans.append(_Span(start, stop, first, last - first))
    return [span for span in spans if edge_handling == "crop" or span.window == size]


def _number(root: Node, name: str, window: WindowMatrix) -> Any:
    """Evaluate the expression for all windows; return one value per window, or a shared number."""
    available = f"{name} (a window expression knows only its input layer)"
    value = Interpreter(WindowMatrices(), {name: window}, available)(root)
    if shape_of(value) != SCALAR:
        shape = describe(shape_of(value))
        text = f"a window expression must give a single number, this one gives {shape}"
        raise Fault(text, position=root.position)
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


def skips_missing(root: Node, name: str) -> bool:
    """Return whether cropping the windows of the layer `name` is equivalent to padding with NaN.

    The check is conservative: it returns False for some equivalent expressions.
    """
    # If a layer hides a function, parentheses after the name mean indexing, not a call.
    return name not in FUNCTIONS and _is_number(root, name)


def _is_number(node: Node, name: str) -> bool:
    """Return whether a subtree gives the same number for cropped and padded windows."""
    match node.kind, node.parts:
        case "number", _:
            return True
        case "name", (other,):
            return other != name and other in CONSTANTS
        case "call", (function, (argument,)) if FUNCTIONS[function].skips_nan:
            return _keeps_missing(argument, name)
        case "call", (function, _):
            elementwise = FUNCTIONS[function].elementwise
        case _:
            elementwise = node.kind in ("unary", "binary")
    return elementwise and all(_is_number(child, name) for child in node.children())


def _keeps_missing(node: Node, name: str) -> bool:
    """Return whether a subtree is NaN wherever the window is, or `_is_number` holds for it."""
    if _is_number(node, name):
        return True
    match node.kind, node.parts:
        case "name", (other,):
            return bool(other == name)
        case "binary", (operator, left, right) if operator in POWERS:
            # NaN ** 0 and 1 ** NaN are 1.
            positive = right.kind == "number" and right.parts[0] > 0.0
            return positive and _keeps_missing(left, name)
        case "binary", (operator, left, right):
            is_product = operator in ("*", "/")
            if is_product and not (_is_number(left, name) or _is_number(right, name)):
                return False
            keeps = operator not in COMPARISONS
        case "call", (function, _):
            keeps = FUNCTIONS[function].keeps_nan
        case _:
            keeps = node.kind == "unary"
    return keeps and all(_keeps_missing(child, name) for child in node.children())
