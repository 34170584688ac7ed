# SPDX-License-Identifier: BSD-3-Clause
"""Evaluates syntax trees, and checks expressions without layers."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from grid_map_core_py.errors import hint

from ._functions import CONSTANTS, FUNCTIONS, LARGEST, operate
from ._matrices import SCALAR, Matrices, Value, describe, known, shape_of, simplified
from ._nodes import Fault, Node

_DEEPEST = 150


class Interpreter:
    """Evaluates the nodes of a syntax tree.

    Args:
        algebra: primitive operations for the type of the values.
        names: values by name; a name hides the function or constant of the same name.
    """

    def __init__(self, algebra: Matrices, names: Mapping[str, Value], available: str) -> None:
        self._algebra = algebra
        self._names = names
        self._available = available

    def __call__(self, node: Node, end: int | None = None) -> Value:
        # For small maps, `node.blamed()` would take longer than the operation.
        try:
            return getattr(self, f"_{node.kind}")(end, *node.parts)
        except Fault as fault:
            fault.position = node.position if fault.position is None else fault.position
            raise

    def _number(self, _end: int | None, number: float) -> Value:
        return number

    def _name(self, _end: int | None, name: str, kind: str = "layer") -> Value:
        if name in self._names:
            return self._names[name]
        if name in CONSTANTS:
            return CONSTANTS[name]
        similar = hint(name, self._available.split(", ") if kind == "layer" else FUNCTIONS)
        raise Fault(f"no {kind} {name!r}; available: {self._available}{similar}")

    def _end(self, end: int | None) -> Value:
        if end is None:
            raise Fault("'end' is valid only in an index")
        return float(end)

    def _all(self, _end: int | None) -> Value:
        raise Fault("':' alone is valid only in an index")

    def _unary(self, end: int | None, operator: str, operand: Node) -> Value:
        value = self(operand, end)
        return self._algebra.elementwise(np.negative, value) if operator == "-" else value

    def _binary(self, end: int | None, operator: str, left: Node, right: Node) -> Value:
        return operate(self._algebra, operator, self(left, end), self(right, end))

    def _call(self, end: int | None, name: str, arguments: tuple[Node, ...]) -> Value:
        if name in self._names:
            try:
                return self._take(self._names[name], arguments)
            except Fault as fault:
                message = f"{fault} (the layer {name!r} hides the function)"
                raise Fault(message, position=fault.position) from None
        _check_count(name, arguments)
        values = [self(argument, end) for argument in arguments]
        try:
            return FUNCTIONS[name].apply(self._algebra, *values)
        except Fault as fault:
            if fault.argument is not None:
                fault.position = arguments[fault.argument].position
            raise

    def _range(self, end: int | None, first: Node, step: Node | None, last: Node) -> Value:
        start, stop = self._bound(first, end), self._bound(last, end)
        stride = 1.0 if step is None else self._bound(step, end)
        if start == stop:
            return start
        count = (stop - start) / stride if stride else math.nan
        if not 0.0 <= count < LARGEST:
            raise Fault(f"the range {start:g}:{stride:g}:{stop:g} is empty or endless")
        # Because of the tolerance, 0:0.1:0.3 ends at 0.3 despite rounding errors.
        places = np.arange(math.floor(count + 1e-9) + 1)
        return simplified((start + stride * places).astype(np.float32).reshape(1, -1))

    def _bound(self, node: Node, end: int | None) -> float:
        value = self(node, end)
        with node.blamed():
            if shape_of(value) != SCALAR:
                raise Fault(f"a range needs numbers, this is {describe(shape_of(value))}")
            return float(np.max(known(value)))

    def _matrix(self, end: int | None, *rows: tuple[Node, ...]) -> Value:
        blocks = [[self(node, end) for node in row] for row in rows]
        shapes = [[shape_of(block) for block in row] for row in blocks]
        widths = [sum(width for _, width in row) for row in shapes]
        for nodes, row, width in zip(rows, shapes, widths, strict=True):
            for node, (height, _) in zip(nodes, row, strict=True):
                if height != row[0][0]:
                    text = f"this part has {height} rows, the first part of its row {row[0][0]}"
                    raise Fault(text, position=node.position)
            if width != widths[0]:
                text = f"this row has {width} columns, the first row {widths[0]}"
                raise Fault(text, position=nodes[0].position)
        return self._algebra.stack(blocks)

    def _index(self, end: int | None, base: Node, places: tuple[Node, ...]) -> Value:
        if base.kind == "name":
            return self._take(self._name(end, base.parts[0], "layer or function"), places)
        return self._take(self(base, end), places)

    def _take(self, base: Value, arguments: tuple[Node, ...]) -> Value:
        shape = shape_of(base)
        if len(arguments) == 2:
            rows, columns = map(self._places, arguments, shape)
        elif len(arguments) != 1:
            raise Fault("an index has one or two places, m(row, column) or v(place)")
        elif 1 in shape:
            places, first = self._places(arguments[0], max(shape)), np.zeros(1, np.intp)
            rows, columns = (first, places) if shape[0] == 1 else (places, first)
        else:
            raise Fault(
                f"one index needs a vector, this is {describe(shape)}; write m(row, column)"
            )
        return self._algebra.take(base, rows, columns)

    def _places(self, argument: Node, length: int) -> NDArray[np.intp]:
        if argument.kind == "all":
            return np.arange(length)
        with argument.blamed():
            return _as_places(known(self(argument, length - 1)), length)


def _as_places(value: Value, length: int | None = None) -> NDArray[np.intp]:
    """Convert a number or vector to indices; raise a Fault unless they are in [0, `length`)."""
    numbers = np.atleast_2d(np.asarray(value, np.float64))
    if 1 not in numbers.shape:
        raise Fault(f"an index is a number or a vector, not {' x '.join(map(str, numbers.shape))}")
    for number in numbers.flat:
        if not number.is_integer():
            raise Fault(f"an index must be a whole number, not {number:g}")
        if number < 0 or (length is not None and number >= length):
            upper = "" if length is None else f" to {length - 1}"
            raise Fault(f"index {number:g} is out of range; indices go from 0{upper}")
    return numbers.ravel().astype(np.intp)


def _check_count(name: str, arguments: tuple[Node, ...]) -> None:
    """Raise a Fault unless the function accepts this number of arguments."""
    function, count = FUNCTIONS[name], len(arguments)
    if function.least <= count <= function.most:
        return
    wanted = " or ".join(map(str, dict.fromkeys((function.least, function.most))))
    plural = "" if wanted == "1" else "s"
    raise Fault(f"{name} takes {wanted} argument{plural}, not {count}")


# --- checks without layers ------------------------------------------------------------------------

# Parts that do not depend on layers are evaluated when the expression is created, so that errors
# such as `[1, 2] + [1, 2, 3]` or `zeros(1.5)` are found early. Calls that may index a layer are
# checked later: `mean(2, 3)` is a cell if there is a layer `mean`.

_EVALUATE = Interpreter(Matrices(), {}, "")


def check(node: Node, *, indexing: bool = False, depth: int = 0) -> None:
    """Raise a Fault if a subtree at `depth` is invalid regardless of the layers.

    `indexing` is True if the node may be part of an index.
    """
    if depth > _DEEPEST:
        raise Fault("the expression is nested too deeply", position=node.position)
    if node.kind in ("end", "all") and not indexing:
        raise Fault("'end' and a lone ':' are valid only in an index", position=node.position)
    for child in node.children():
        check(child, indexing=indexing or node.kind in ("index", "call"), depth=depth + 1)
    with node.blamed():
        if _is_constant(node):
            _EVALUATE(node)
        elif node.kind == "call" and not may_be_index(node):
            _check_call(*node.parts)
        elif node.kind == "index":
            base, places = node.parts
            if len(places) > 2:
                name = base.parts[0] if base.kind == "name" else ""
                unknown = f"no function {name!r}{hint(name, FUNCTIONS)}, and " if name else ""
                raise Fault(f"{unknown}an index has one or two places, m(row, column) or v(place)")
            for place in filter(_is_constant, places):
                with place.blamed():
                    _as_places(_EVALUATE(place))


def _check_call(name: str, arguments: tuple[Node, ...]) -> None:
    _check_count(name, arguments)
    function, axis = FUNCTIONS[name], arguments[-1]
    if function.axis and len(arguments) == 2 and _is_constant(axis):
        value = _EVALUATE(axis)
        if isinstance(value, float):
            with axis.blamed():
                function.apply(Matrices(), 0.0, value)


def _is_constant(node: Node) -> bool:
    """Return True if the value does not depend on the layers."""
    if node.kind in ("name", "end", "all") or (node.kind == "call" and may_be_index(node)):
        return False
    return all(map(_is_constant, node.children()))


def may_be_index(call: Node) -> bool:
    """Return True if `name(arguments)` may index a layer that has the name of a function."""
    _, arguments = call.parts
    return len(arguments) <= 2 and all(
        float(node.parts[0]).is_integer()
        if node.kind == "number"
        else node.kind == "range" or any(part.kind in ("end", "all") for part in node.descendants())
        for node in arguments
    )
