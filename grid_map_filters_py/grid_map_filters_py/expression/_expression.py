# SPDX-License-Identifier: BSD-3-Clause
"""Mathematical expressions with layers as variables."""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Size
from grid_map_core_py.regions._sliding_window import EdgeHandling

from ..errors import ExpressionError
from ._cells import Analysis
from ._functions import CONSTANTS, FUNCTIONS
from ._interpreter import Interpreter, check
from ._matrices import Combined, Matrices, Partial
from ._nodes import Fault, Node
from ._parser import parse
from ._windows import evaluate_over_windows

if TYPE_CHECKING:
    from grid_map_core_py.tiled import TiledMap


@dataclass(frozen=True)
class Expression:
    """A mathematical expression with layers as variables, parsed once.

    Expressions are immutable. Expressions with the same text are equal.

    Args:
        text: the expression, for example `0.5 * slope ./ 0.6 + acos(normal_vectors_z)`.

    Raises:
        ExpressionError: the text is not an expression, or the expression is invalid for all layers.
            The message shows the position.

    Example:
        >>> Expression("1 + 2 * [1, 2]")({})
        array([[3., 5.]], dtype=float32)
    """

    text: str
    names: frozenset[str] = field(init=False, repr=False, compare=False)
    """Names of the layers that the expression requires."""

    _root: Node = field(init=False, repr=False, compare=False)
    _places: dict[str, int] = field(init=False, repr=False, compare=False)
    _layers: frozenset[str] | None = field(init=False, repr=False, compare=False, default=None)
    """Layers of the tiled map, set by `for_tiles_of`; None if any map is allowed."""

    def __post_init__(self) -> None:
        if not isinstance(self.text, str):
            raise ExpressionError(f"an expression must be a text, not {self.text!r}")
        with _faults_as_errors(self.text):
            root = parse(self.text)
            check(root)
        self._set(root)

    def _set(self, root: Node) -> None:
        nodes = list(root.descendants())
        names, functions = (
            {node.parts[0]: node.position for node in nodes if node.kind == kind}
            for kind in ("name", "call")
        )
        object.__setattr__(self, "names", frozenset(names.keys() - CONSTANTS.keys()))
        object.__setattr__(self, "_root", root)
        object.__setattr__(self, "_places", functions | names)

    @property
    def is_cellwise(self) -> bool:
        """True if each cell of the result depends only on the same cell of the layers."""
        return Analysis(self._layers).is_cellwise(self._root)

    def why_whole_map(self, layers: Container[str]) -> str:
        """Return why the expression cannot be computed tile by tile for these layers; "" if it can.

        Reductions do not count, because `for_tiles_of` computes them in advance.
        """
        culprit = Analysis(layers, reduced=True).culprit(self._root)
        if culprit is None:
            return ""
        return _shown("this part needs whole layers", self.text, culprit.position)

    def for_tiles_of(self, tiled_map: "TiledMap") -> "Expression":
        """Return a copy of the expression that can be evaluated tile by tile.

        Each reduction is replaced by its value over the whole map. The partial results of the
        tiles are combined in double precision, in tile order. Nested reductions are computed
        from the inside out.

        Args:
            tiled_map: input map; its layers hide functions and constants of the same name.

        Raises:
            ExpressionError: apart from its reductions, the expression is not cellwise.
        """
        root, layers = self._root, frozenset(tiled_map.layers)
        while nodes := [*Analysis(layers).reductions(root)]:
            parts = _PartsOfTile(self, nodes)
            of_tiles = tiled_map.over_tiles(parts, sorted(parts.names & layers))
            numbers = parts.combined(of_tiles, tiled_map.size)
            root = root.with_numbers(dict(zip(nodes, numbers, strict=True)))
        bound = Expression(self.text)
        bound._set(root)
        object.__setattr__(bound, "_layers", layers)
        if not bound.is_cellwise:
            raise ExpressionError(self.why_whole_map(layers))
        return bound

    def is_changed_by(self, names: Iterable[str]) -> bool:
        """Return whether a layer hides a function or a constant that the expression uses."""
        return any(name in self._places and name not in self.names for name in names)

    def __call__(self, layers: Mapping[str, NDArray[Any]]) -> NDArray[np.float32] | float:
        """Evaluate the expression for whole layers.

        Elementwise operations use float32 and keep the memory order of the layers. Reductions use
        double precision. Infinities and NaN follow IEEE 754, without warnings.

        Args:
            layers: a map, or (rows, columns) arrays by name; a layer hides the function or constant
                of the same name. Only layers that the expression names are read; no layer is
                changed.

        Returns:
            A new float32 matrix, or a number if the expression reduces to one. The matrix has the
            buffer order of the layers, so `map["out"] = expression(map)` works.

        Raises:
            ExpressionError: a layer is missing, or shapes or indices do not fit.
        """
        if isinstance(layers, GridMap) and layers.start_index != (0, 0):
            result = self({name: layers.unwrapped(name) for name in layers})
            if isinstance(result, float) or result.shape != layers.size:
                return result
            stored = layers.without_layers(layers)
            stored.set_unwrapped("result", result)
            return stored["result"]
        with _faults_as_errors(self.text):
            result = self._interpreter(layers)(self._root)
        is_shared = isinstance(result, np.ndarray) and not result.flags.writeable
        return np.copy(result, order="K") if is_shared else result

    def _interpreter(self, layers: Mapping[str, NDArray[Any]]) -> Interpreter:
        used = self._places.keys() & layers.keys()
        values = {name: _bind(name, layers[name], self._places[name]) for name in used}
        return Interpreter(Matrices(), values, ", ".join(sorted(layers)) or "none")

    def fill(self, out: NDArray[np.float32], layers: Mapping[str, NDArray[Any]]) -> None:
        """Evaluate the expression and write the result to an existing array, to save memory.

        `out` and the `layers` that the expression names are (rows, columns) arrays.
        """
        values = {name: _bind(name, layers[name], self._places[name]) for name in layers}
        with _faults_as_errors(self.text):
            result = Interpreter(Matrices(out), values, "")(self._root)
        if result is not out:
            out[...] = result

    def over_windows(
        self,
        name: str,
        layer: NDArray[Any],
        window_size: int,
        edge_handling: EdgeHandling,
        *,
        compute_empty_cells: bool = True,
    ) -> NDArray[np.float32]:
        """Evaluate the expression for the square window around every cell.

        The expression must return a number for a window, and may name only the input layer. All
        cells are computed together, in double precision.

        Args:
            name: name of the input layer, which stands for the window values in the expression.
            layer: (rows, columns) array with start index (0, 0).
            window_size: odd number of cells along a side.
            edge_handling: treatment of windows that extend beyond the map. `inside`: the result is
                NaN. `crop`: the window is cropped to the map. `empty`: cells beyond the map are
                NaN. `mean`: these cells get the mean of the finite values in the window.
            compute_empty_cells: if False, the result is NaN wherever the input is NaN.

        Returns:
            (rows, columns) float32 in Fortran order.

        Raises:
            ExpressionError: the result is not a number, or names, shapes or indices do not fit.
            FilterError: the window size or the edge handling is invalid.
        """
        if not np.issubdtype(np.asarray(layer).dtype, np.floating):
            layer = np.asarray(layer, np.float32)
        with _faults_as_errors(self.text):
            result = evaluate_over_windows(self._root, name, layer, window_size, edge_handling)
        if not compute_empty_cells:
            result[np.isnan(layer)] = np.nan
        return result


@dataclass(frozen=True)
class _PartsOfTile:
    """Computes the partial results of reductions, such as `sum(...)`, on one tile."""

    expression: Expression
    nodes: Sequence[Node]

    @property
    def names(self) -> set[str]:
        """Names of all layers in the arguments."""
        parts = (part for node in self.nodes for part in node.descendants())
        return {part.parts[0] for part in parts if part.kind in ("name", "call")}

    def __call__(self, layers: Mapping[str, NDArray[Any]]) -> list[list[float]]:
        """Return the partial results of each reduction on a tile."""
        with _faults_as_errors(self.expression.text):
            interpreter = self.expression._interpreter(layers)
            partials = []
            for node in self.nodes:
                partials.append(partial := Partial())
                function, arguments = node.parts
                FUNCTIONS[function].apply(partial, *map(interpreter, arguments))
        return [partial.parts for partial in partials]

    def combined(self, of_tiles: Sequence[list[list[float]]], size: Size) -> list[float]:
        """Combine the results of all tiles into the value of each reduction over the map."""
        # Only the shape of this array is used.
        whole = np.broadcast_to(np.float32(0), size)
        results = []
        with _faults_as_errors(self.expression.text):
            for node, parts in zip(self.nodes, zip(*of_tiles, strict=True), strict=True):
                function, (_, *others) = node.parts
                numbers = map(Interpreter(Matrices(), {}, ""), others)
                algebra = Combined(zip(*parts, strict=True))
                results.append(FUNCTIONS[function].apply(algebra, whole, *numbers))
        return results


def _bind(name: str, layer: NDArray[Any], position: int) -> NDArray[np.float32]:
    """Return a layer as a read-only float32 array: a view, or a copy if the type differs."""
    values = np.asarray(layer).astype(np.float32, copy=False).view()
    if values.ndim != 2:
        message = f"the layer {name!r} must have rows and columns, its shape is {values.shape}"
        raise Fault(message, position=position)
    values.flags.writeable = False
    return values


@contextmanager
def _faults_as_errors(text: str) -> Iterator[None]:
    """Context that converts a `Fault` to an `ExpressionError` and suppresses NumPy warnings."""
    try:
        with np.errstate(all="ignore"):
            yield
    except Fault as fault:
        raise ExpressionError(_shown(str(fault), text, fault.position or 0)) from None


def _shown(message: str, text: str, position: int) -> str:
    """Return a message and the expression, with a caret under `position`."""
    line = "".join(" " if character.isspace() else character for character in text)
    return f"{message}\n    {line}\n    {' ' * position}^"
