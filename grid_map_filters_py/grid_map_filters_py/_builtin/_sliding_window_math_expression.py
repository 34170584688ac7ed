# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/SlidingWindowMathExpressionFilter`"""

import math
from dataclasses import dataclass, field
from typing import Literal

from grid_map_core_py._arrays import Layer
from grid_map_core_py.plugins import check

from ..expression import Expression
from ..parts._layer_filter import LayerFilter


@dataclass(frozen=True, kw_only=True)
class SlidingWindowMathExpression(LayerFilter):
    """Evaluate an expression for the square window around each cell.

    The result of the expression must be a scalar, which becomes the value of the cell.

    Attributes:
        input_layer: layer to filter; in the expression, its name stands for the window values.
        expression: expression to evaluate, for example `meanOfFinites(elevation)`.
        compute_empty_cells: also compute cells that are NaN in the input.
        edge_handling: how to evaluate a window that extends beyond the map. "inside": the cell
            becomes NaN. "crop": the window is cropped to the map. "empty": the window is padded
            with NaN. "mean": the window is padded with the mean of its finite values.
        window_size: side length of the window [cells]; must be odd.
        window_length: side length of the window [m], rounded to an odd number of cells; overrides
            `window_size`.
    """

    expression: str
    compute_empty_cells: bool = True
    edge_handling: Literal["inside", "crop", "empty", "mean"] = "inside"
    window_size: int = 3
    window_length: float | None = None
    _parsed: Expression = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        odd = self.window_size > 0 and self.window_size % 2 == 1
        check(odd, "window_size", "an odd number of cells", self.window_size)
        length = self.window_length
        positive = length is None or (math.isfinite(length) and length > 0)
        check(positive, "window_length", "a length > 0 [m]", length)
        parsed = Expression(self.expression)
        known = parsed.names <= {self.input_layer}
        expected = f"no layer but the input layer {self.input_layer!r}"
        check(known, "expression", expected, self.expression)
        object.__setattr__(self, "_parsed", parsed)

    def reach(self, resolution: float) -> float:
        return self._cells(resolution) // 2

    def _cells(self, resolution: float) -> int:
        if self.window_length is None:
            return self.window_size
        cells = math.floor(self.window_length / resolution + 0.5)
        return cells + 1 - cells % 2

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        return self._parsed.over_windows(
            self.input_layer,
            layer,
            self._cells(resolution),
            self.edge_handling,
            compute_empty_cells=self.compute_empty_cells,
        )
