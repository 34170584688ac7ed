# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Analysis of expressions: may a cropped window be padded with NaN instead?

It may if every use of the window ends in a reduction that skips NaN, and all earlier functions
keep NaN. Then all cells have windows of one size, and the border needs no special treatment.
"""

from ._functions import COMPARISONS, CONSTANTS, FUNCTIONS, POWERS
from ._nodes import Binary, Call, Name, Node, Number, Unary, children


def skips_missing(root: Node, name: str) -> bool:
    """Return True if cropping the windows of the layer `name` equals padding them with NaN.

    It also returns False if this simple analysis cannot decide.
    """
    # If a layer has the name of a function, its parentheses mean indexing, not a call.
    return name not in FUNCTIONS and _is_number(root, name)


def _is_number(node: Node, name: str) -> bool:
    """Return True if a subtree gives the same single number for both kinds of windows."""
    match node:
        case Number():
            return True
        case Name(name=other):
            return other != name and other in CONSTANTS
        case Call(function=function, arguments=(argument,)) if FUNCTIONS[function].skips_nan:
            return _keeps_missing(argument, name)
        case Call(function=function):
            elementwise = FUNCTIONS[function].elementwise
        case _:
            elementwise = isinstance(node, Unary | Binary)
    return elementwise and all(_is_number(child, name) for child in children(node))


def _keeps_missing(node: Node, name: str) -> bool:
    """Return True if a subtree is a number, or keeps every NaN of the window in place."""
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
                and (
                    operator not in ("*", "/") or _is_number(left, name) or _is_number(right, name)
                )
                and _keeps_missing(left, name)
                and _keeps_missing(right, name)
            )
        case Call(function=function, arguments=arguments) if FUNCTIONS[function].keeps_nan:
            return all(_keeps_missing(argument, name) for argument in arguments)
    return False
