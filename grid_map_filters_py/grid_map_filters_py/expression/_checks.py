# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Checks of an expression that need no layers.

Parts without names are evaluated once, so that `[1, 2] + [1, 2, 3]` or `zeros(1.5)` fails when the
expression is built. A layer hides the function of the same name: `mean(2, 3)` may be a cell of the
layer `mean`. So calls whose arguments could be an index are checked only with the layers.
"""

from ._faults import Fault
from ._functions import FUNCTIONS, Plain
from ._interpreter import Interpreter, as_places, check_count, suggestion
from ._matrices import Matrices
from ._nodes import All, Call, End, Index, Name, Node, Number, Range, children, descendants

_DEEPEST = 150

_EVALUATE: Interpreter[Plain] = Interpreter(Matrices(), {}, "")


def check(node: Node, *, indexing: bool = False, depth: int = 0) -> None:
    """Raise a Fault for an error that does not depend on the layers.

    Args:
        node: root of the tree, or of a subtree at this depth.
        indexing: the node is inside of a possible index.
    """
    if depth > _DEEPEST:
        raise Fault("the expression is nested too deeply", position=node.position)
    if isinstance(node, End | All) and not indexing:
        raise Fault("'end' and a lone ':' stand only in an index", position=node.position)
    inner = indexing or isinstance(node, Index | Call)
    for child in children(node):
        check(child, indexing=inner, depth=depth + 1)
    try:
        if _is_known(node):
            _EVALUATE(node)
        elif isinstance(node, Call) and not _may_be_index(node.arguments):
            _check_call(node)
        elif isinstance(node, Index):
            _check_index(node)
    except Fault as fault:
        raise fault.located(node.position) from None


def _check_call(call: Call) -> None:
    check_count(call.function, call.arguments)
    function, axis = FUNCTIONS[call.function], call.arguments[-1]
    if function.axis and len(call.arguments) == 2 and _is_known(axis):
        value = _EVALUATE(axis)
        if isinstance(value, float):
            try:
                function.apply(Matrices(), 0.0, value)
            except Fault as fault:
                raise fault.located(axis.position) from None


def _check_index(index: Index) -> None:
    if len(index.arguments) > 2:
        name = index.base.name if isinstance(index.base, Name) else ""
        unknown = f"no function {name!r}{suggestion(name)}, and " if name else ""
        raise Fault(f"{unknown}an index has one or two places, m(row, column) or v(place)")
    for argument in filter(_is_known, index.arguments):
        try:
            as_places(_EVALUATE(argument))
        except Fault as fault:
            raise fault.located(argument.position) from None


def _is_known(node: Node) -> bool:
    """Return True if the value is the same for all layers."""
    if isinstance(node, Name | End | All):
        return False
    if isinstance(node, Call) and _may_be_index(node.arguments):
        return False
    return all(map(_is_known, children(node)))


def _may_be_index(arguments: tuple[Node, ...]) -> bool:
    return len(arguments) <= 2 and all(map(_may_be_place, arguments))


def _may_be_place(node: Node) -> bool:
    if isinstance(node, Number):
        return node.value.is_integer()
    return isinstance(node, Range) or any(isinstance(part, End | All) for part in descendants(node))
