# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Checks of an expression before any layer is known.

Parts without names are evaluated once, so that `[1, 2] + [1, 2, 3]` or `zeros(1.5)` fails when the
expression is built. A layer hides the function of the same name: `mean(2, 3)` may be a cell of the
layer `mean`. So calls whose arguments could be an index are checked only with the layers.
"""

from collections.abc import Callable
from functools import partial

from ._faults import Fault
from ._functions import FUNCTIONS
from ._interpreter import Interpreter, as_places, check_count, suggestion
from ._matrices import Matrices
from ._nodes import All, Call, End, Index, Name, Node, Number, Range, children, descendants

_DEEPEST = 150


def check(root: Node) -> None:
    """Raise a Fault for an error that does not depend on the layers."""
    _Checker().visit(root, indexing=False, depth=0)


class _Checker:
    def __init__(self) -> None:
        self._evaluate = Interpreter(Matrices(), {}, "")

    def visit(self, node: Node, *, indexing: bool, depth: int) -> None:
        """Check a subtree; `indexing` is True inside of a possible index."""
        if depth > _DEEPEST:
            raise Fault("the expression is nested too deeply", position=node.position)
        if isinstance(node, End | All) and not indexing:
            raise Fault("'end' and a lone ':' stand only in an index", position=node.position)
        inner = indexing or isinstance(node, Index | Call)
        for child in children(node):
            self.visit(child, indexing=inner, depth=depth + 1)
        try:
            self._check_node(node)
        except Fault as fault:
            raise fault.located(node.position) from None

    def _check_node(self, node: Node) -> None:
        if _is_known(node):
            self._evaluate(node)
        elif isinstance(node, Call) and not _may_be_index(node.arguments):
            self._check_call(node)
        elif isinstance(node, Index):
            self._check_index(node)

    def _check_call(self, call: Call) -> None:
        check_count(call.function, call.arguments)
        if FUNCTIONS[call.function].axis and len(call.arguments) == 2:
            axis = call.arguments[1]
            if _is_known(axis) and isinstance(value := self._evaluate(axis), float):
                apply = partial(FUNCTIONS[call.function].apply, Matrices())
                _at(axis, lambda: apply(0.0, value))

    def _check_index(self, index: Index) -> None:
        if len(index.arguments) > 2:
            name = index.base.name if isinstance(index.base, Name) else ""
            unknown = f"no function {name!r}{suggestion(name)}, and " if name else ""
            raise Fault(f"{unknown}an index has one or two places, m(row, column) or v(place)")
        for argument in index.arguments:
            if _is_known(argument):
                value = self._evaluate(argument)
                _at(argument, partial(as_places, value))


def _at(node: Node, action: Callable[[], object]) -> None:
    try:
        action()
    except Fault as fault:
        raise Fault(fault.message, position=node.position) from None


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
