# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Expressions of single cells: each cell of the result depends on the same cell of the layers."""

from enum import Enum

from ._functions import CONSTANTS, FUNCTIONS
from ._interpreter import may_be_index
from ._nodes import Node


class _Kind(Enum):
    NUMBER = "number"
    CELLS = "matrix of the shape of the layers, computed cell by cell"
    OTHER = "anything else, or undecided"


def is_cellwise(root: Node) -> bool:
    """Return True if an expression is a number, or one of single cells.

    Names of functions and constants must not be those of layers. The result is False if this simple
    analysis cannot decide.
    """
    return _kind(root) is not _Kind.OTHER


def _kind(node: Node) -> _Kind:
    match node.kind, node.parts:
        case "number", _:
            return _Kind.NUMBER
        case "name", (name,):
            return _Kind.NUMBER if name in CONSTANTS else _Kind.CELLS
        case "unary", (_, operand):
            return _kind(operand)
        case "binary", (operator, left, right):
            kinds = [_kind(left), _kind(right)]
            # These are the operators of matrices.
            if operator in ("*", "/") and _Kind.NUMBER not in kinds:
                return _Kind.OTHER
        case "call", (function, arguments) if not may_be_index(node):
            kinds = [_kind(argument) for argument in arguments]
            # With a matrix as the second argument, these compare cell by cell.
            pairwise = function in ("min", "max") and kinds[1:] == [_Kind.CELLS]
            if not (FUNCTIONS[function].elementwise or pairwise):
                return _Kind.OTHER
        case _:
            return _Kind.OTHER
    found = set(kinds)
    return next(kind for kind in (_Kind.OTHER, _Kind.CELLS, _Kind.NUMBER) if kind in found)
