# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""When a smaller window gives the same as a window padded with NaN.

It does where every use of the window ends in a reduction of the finite values, and what comes
before turns NaN into NaN. All cells are then alike, and the border needs no treatment of its own.
"""

from ._functions import ARITHMETIC, COMPARISONS, CONSTANTS, FUNCTIONS, OF_FINITES, POWERS, STRICT
from ._nodes import Binary, Call, Name, Node, Number, Unary, children

_POINTWISE = {*STRICT, "isfinite", "atan2", "where", "cwiseMin", "cwiseMax"}
_STRICT = {*STRICT, "atan2", "cwiseMin", "cwiseMax"}


def skips_missing(root: Node, name: str) -> bool:
    """Tell whether cropping the windows of the layer `name` equals padding them with NaN.

    False may also mean that this simple analysis cannot tell.
    """
    # A layer that is called like a function turns calls into indices.
    return name not in FUNCTIONS and _is_number(root, name)


def _is_number(node: Node, name: str) -> bool:
    """Tell whether a subtree gives the same single number for both kinds of windows."""
    match node:
        case Number():
            return True
        case Name(name=other):
            return other != name and other in CONSTANTS
        case Call(function=function, arguments=(argument,)) if function in OF_FINITES:
            return _keeps_missing(argument, name)
        case Call(function=function):
            pointwise = function in _POINTWISE
        case _:
            pointwise = isinstance(node, Unary | Binary)
    return pointwise and all(_is_number(child, name) for child in children(node))


def _keeps_missing(node: Node, name: str) -> bool:
    """Tell whether a subtree is a number, or the window with every NaN kept at its place."""
    if _is_number(node, name):
        return True
    match node:
        case Name(name=other):
            return other == name
        case Unary(operand=operand):
            return _keeps_missing(operand, name)
        case Binary(operator=operator, left=left, right=right) if operator in POWERS:
            # NaN to the power 0, and 1 to the power NaN, are 1.
            positive = isinstance(right, Number) and right.value > 0.0
            return positive and _keeps_missing(left, name)
        case Binary(operator=operator, left=left, right=right):
            return (
                operator not in COMPARISONS
                and (operator in ARITHMETIC or _is_number(left, name) or _is_number(right, name))
                and _keeps_missing(left, name)
                and _keeps_missing(right, name)
            )
        case Call(function=function, arguments=arguments) if function in _STRICT:
            return all(_keeps_missing(argument, name) for argument in arguments)
    return False
