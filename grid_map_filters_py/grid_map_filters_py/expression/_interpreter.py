# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Evaluation of a syntax tree, for any kind of values (`Algebra`)."""

import difflib
import math
from collections.abc import Collection, Mapping
from typing import Generic

import numpy as np
from numpy.typing import NDArray

from ._faults import Fault
from ._functions import CONSTANTS, FUNCTIONS, LARGEST, SCALAR, Algebra, Plain, V, describe, operate
from ._nodes import All, Binary, Call, End, Index, Matrix, Name, Node, Number, Range, Unary


class Interpreter(Generic[V]):
    """Evaluates nodes for given values of the names.

    Args:
        algebra: the primitives for this kind of values.
        names: values of the names; they hide functions and constants of the same name.
        available: the existing names, for error messages.
        repeated: structures that occur more than once; their values are kept.
    """

    def __init__(
        self,
        algebra: Algebra[V],
        names: Mapping[str, V],
        available: str,
        repeated: Collection[int] = (),
    ) -> None:
        self._algebra = algebra
        self._names = names
        self._available = available
        self._repeated = repeated
        self._memory: dict[int, V] = {}

    def __call__(self, node: Node, end: int | None = None) -> V:
        """Evaluate `node`.

        Args:
            node: root of the subtree.
            end: the value of `end`; None outside of an index.

        Raises:
            Fault: with its position.
        """
        if node.structure in self._memory:
            return self._memory[node.structure]
        try:
            value = self._evaluate(node, end)
        except Fault as fault:
            raise fault.located(node.position) from None
        if node.structure in self._repeated:
            self._memory[node.structure] = value
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        return value

    def _evaluate(self, node: Node, end: int | None) -> V:
        match node:
            case Unary(operator=operator, operand=operand):
                value = self(operand, end)
                minus = operator == "-"
                return self._algebra.elementwise(np.negative, value) if minus else value
            case Binary(operator=operator, left=left, right=right):
                return operate(self._algebra, operator, self(left, end), self(right, end))
            case Call():
                return self._call(node, end)
            case Index(base=Name(name=name), arguments=arguments):
                return self._index(self._name(name, "layer or function"), arguments)
            case Index(base=base, arguments=arguments):
                return self._index(self(base, end), arguments)
            case Range():
                return self._range(node, end)
            case Matrix(rows=rows):
                return self._matrix(rows, end)
        return self._leaf(node, end)

    def _leaf(self, node: Node, end: int | None) -> V:
        match node:
            case Number(value=number):
                return self._algebra.constant(number)
            case Name(name=name):
                return self._name(name)
            case End() if end is not None:
                return self._algebra.constant(float(end))
        symbol = "'end'" if isinstance(node, End) else "':' alone"
        raise Fault(f"{symbol} stands only in an index")

    def _name(self, name: str, kind: str = "layer") -> V:
        if name in self._names:
            return self._names[name]
        if name in CONSTANTS:
            return self._algebra.constant(CONSTANTS[name])
        hint = "" if kind == "layer" else suggestion(name)
        raise Fault(f"no {kind} {name!r}{hint}; available: {self._available}")

    def _call(self, call: Call, end: int | None) -> V:
        name, arguments = call.function, call.arguments
        if name in self._names:
            try:
                return self._index(self._names[name], arguments)
            except Fault as fault:
                message = f"{fault.message} (the layer {name!r} hides the function)"
                raise Fault(message, position=fault.position) from None
        check_count(name, arguments)
        values = [self(argument, end) for argument in arguments]
        try:
            result: V = FUNCTIONS[name].apply(self._algebra, *values)
        except Fault as fault:
            blamed = fault.argument
            raise fault if blamed is None else fault.located(arguments[blamed].position) from None
        return result

    def _range(self, node: Range, end: int | None) -> V:
        start, stop = self._number(node.first, end), self._number(node.last, end)
        stride = 1.0 if node.step is None else self._number(node.step, end)
        if start == stop:
            return self._algebra.constant(start)
        count = (stop - start) / stride if stride else math.nan
        if not 0.0 <= count < LARGEST:
            raise Fault(f"the range {start:g}:{stride:g}:{stop:g} is empty or endless")
        # The tolerance lets 0:0.1:0.3 end at 0.3 in spite of round-off.
        places = np.arange(math.floor(count + 1e-9) + 1)
        row = (start + stride * places).astype(np.float32).reshape(1, -1)
        return self._algebra.constant(float(row.item()) if row.size == 1 else row)

    def _number(self, node: Node, end: int | None) -> float:
        value = self(node, end)
        if self._algebra.shape(value) != SCALAR:
            shape = describe(self._algebra.shape(value))
            raise Fault(f"a range needs numbers, this is {shape}", position=node.position)
        return float(np.max(self._known(value, node)))

    def _matrix(self, rows: tuple[tuple[Node, ...], ...], end: int | None) -> V:
        blocks = [[self(node, end) for node in row] for row in rows]
        shapes = [[self._algebra.shape(block) for block in row] for row in blocks]
        for nodes, row in zip(rows, shapes, strict=True):
            for node, shape in zip(nodes, row, strict=True):
                if shape[0] != row[0][0]:
                    raise Fault(
                        f"this part has {shape[0]} rows, the first part of its row {row[0][0]}",
                        position=node.position,
                    )
        widths = [sum(shape[1] for shape in row) for row in shapes]
        for nodes, width in zip(rows, widths, strict=True):
            if width != widths[0]:
                raise Fault(
                    f"this row has {width} columns, the first row {widths[0]}",
                    position=nodes[0].position,
                )
        return self._algebra.stack(blocks)

    def _index(self, base: V, arguments: tuple[Node, ...]) -> V:
        shape = self._algebra.shape(base)
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
        if isinstance(argument, All):
            return np.arange(length)
        try:
            return as_places(self._known(self(argument, length - 1), argument), length)
        except Fault as fault:
            raise fault.located(argument.position) from None

    def _known(self, value: V, node: Node) -> Plain:
        try:
            return self._algebra.known(value)
        except Fault as fault:
            raise fault.located(node.position) from None


def as_places(value: Plain, length: int | None = None) -> NDArray[np.intp]:
    """Return an index value as places; `length` of the dimension where it is known."""
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


def check_count(name: str, arguments: tuple[Node, ...]) -> None:
    """Raise a Fault unless the function takes this number of arguments."""
    function, count = FUNCTIONS[name], len(arguments)
    if function.least <= count <= function.most:
        return
    wanted = str(function.least)
    if function.most != function.least:
        wanted += f" or {function.most}"
    plural = "" if wanted == "1" else "s"
    raise Fault(f"{name} takes {wanted} argument{plural}, not {count}")


def suggestion(name: str) -> str:
    """Suggest a function that is spelled like `name`, in brackets."""
    close = difflib.get_close_matches(name, FUNCTIONS, n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""
