# SPDX-License-Identifier: BSD-3-Clause
"""Detects cellwise expressions.

In a cellwise expression, each cell of the result depends only on the same cell of the layers.
Reductions such as `max(elevation)` are not cellwise until they are replaced with their values.
"""

from collections.abc import Container, Iterator
from dataclasses import dataclass
from enum import Enum

from ._functions import CONSTANTS, FUNCTIONS
from ._interpreter import may_be_index
from ._nodes import Node


class _Kind(Enum):
    NUMBER = "number"
    CELLS = "matrix of the shape of the layers, computed cell by cell"
    OTHER = "anything else, or undecided"


@dataclass(frozen=True)
class Analysis:
    """Finds cellwise parts and reductions of an expression.

    Args:
        layers: names of the layers; a layer hides the function or constant of the same name. None
            means unknown layers: a call that may index a layer counts as indexing.
        reduced: treat reductions as numbers.
    """

    layers: Container[str] | None = None
    reduced: bool = False

    def is_cellwise(self, root: Node) -> bool:
        """Return True if the expression is a number or cellwise."""
        return self._kind(root) is not _Kind.OTHER

    def culprit(self, root: Node) -> Node | None:
        """Return the first innermost part that prevents cellwise evaluation, or None."""
        if self.is_cellwise(root):
            return None
        inner = (self.culprit(child) for child in root.children())
        return next(filter(None, inner), root)

    def reductions(self, root: Node) -> Iterator[Node]:
        """Yield the reductions whose argument is cellwise."""
        for node in root.descendants():
            if node.kind == "call" and not self._is_index(node) and self._reduces(*node.parts):
                yield node

    def _reduces(self, function: str, arguments: tuple[Node, ...]) -> bool:
        kinds = [self._kind(argument) for argument in arguments]
        numbers = [_Kind.NUMBER] * (len(kinds) - 1)
        return FUNCTIONS[function].reduces == len(kinds) and kinds == [_Kind.CELLS, *numbers]

    def _is_index(self, call: Node) -> bool:
        return may_be_index(call) if self.layers is None else call.parts[0] in self.layers

    def _kind(self, node: Node) -> _Kind:
        match node.kind, node.parts:
            case "number", _:
                return _Kind.NUMBER
            case "name", (name,):
                is_hidden = self.layers is not None and name in self.layers
                return _Kind.NUMBER if name in CONSTANTS and not is_hidden else _Kind.CELLS
            case "unary", (_, operand):
                return self._kind(operand)
            case "binary", (operator, left, right):
                kinds = [self._kind(left), self._kind(right)]
                # Between two matrices, `*` and `/` are matrix operators.
                if operator in ("*", "/") and _Kind.NUMBER not in kinds:
                    return _Kind.OTHER
            case "call", (function, arguments) if not self._is_index(node):
                return self._kind_of_call(function, arguments)
            case _:
                return _Kind.OTHER
        return _joined(kinds)

    def _kind_of_call(self, function: str, arguments: tuple[Node, ...]) -> _Kind:
        if self.reduced and self._reduces(function, arguments):
            return _Kind.NUMBER
        kinds = [self._kind(argument) for argument in arguments]
        # If the second argument is a matrix, `min` and `max` compare cell by cell.
        pairwise = function in ("min", "max") and kinds[1:] == [_Kind.CELLS]
        of_number = FUNCTIONS[function].reduces == len(kinds) and {*kinds} == {_Kind.NUMBER}
        if not (FUNCTIONS[function].elementwise or pairwise or of_number):
            return _Kind.OTHER
        return _joined(kinds)


def _joined(kinds: list[_Kind]) -> _Kind:
    found = set(kinds)
    return next(kind for kind in (_Kind.OTHER, _Kind.CELLS, _Kind.NUMBER) if kind in found)
