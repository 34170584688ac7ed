# SPDX-License-Identifier: BSD-3-Clause
"""Syntax tree of an expression, and errors with a position in the text."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class Node:
    """A node of the syntax tree of an expression.

    | kind     | parts                                                                             |
    |----------|-----------------------------------------------------------------------------------|
    | `number` | the value                                                                         |
    | `name`   | the name of a layer or constant                                                   |
    | `end`    | none; `end` is the last index of the dimension that is being indexed              |
    | `all`    | none; a lone `:` stands for every index of the dimension                          |
    | `unary`  | operator, operand                                                                 |
    | `binary` | operator (arithmetic or comparison), left operand, right operand                  |
    | `range`  | first, step (or None), last                                                       |
    | `matrix` | rows, which are tuples of blocks                                                  |
    | `index`  | the indexed node, and a tuple of one or two indices                               |
    | `call`   | the name of a known function, and a tuple of arguments; evaluated as an index if  |
    |          | a layer has the same name                                                         |

    `position` is the column in the text, for error messages.
    """

    kind: str
    parts: tuple[Any, ...]
    position: int

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Context manager that adds the position of this node to faults without a position."""
        try:
            yield
        except Fault as fault:
            if fault.position is None:
                fault.position = self.position
            raise

    def children(self) -> Iterator["Node"]:
        """Yield the direct child nodes from left to right."""
        return _nodes_in(self.parts)

    def descendants(self) -> Iterator["Node"]:
        """Yield this node and all nodes below it."""
        yield self
        for child in self.children():
            yield from child.descendants()

    def with_numbers(self, numbers: Mapping["Node", float]) -> "Node":
        """Return a copy of the tree with some nodes replaced by numbers."""
        if self in numbers:
            return Node("number", (numbers[self],), self.position)
        return Node(self.kind, _with_numbers(self.parts, numbers), self.position)


def _with_numbers(parts: tuple[Any, ...], numbers: Mapping[Node, float]) -> tuple[Any, ...]:
    return tuple(
        part.with_numbers(numbers)
        if isinstance(part, Node)
        else _with_numbers(part, numbers)
        if isinstance(part, tuple)
        else part
        for part in parts
    )


def _nodes_in(parts: tuple[Any, ...]) -> Iterator[Node]:
    for part in parts:
        if isinstance(part, Node):
            yield part
        elif isinstance(part, tuple):
            yield from _nodes_in(part)


class Fault(Exception):
    """An error in an expression.

    Args:
        position: column in the text; None while unknown.
        argument: index of the function argument that caused the fault; None otherwise.
    """

    def __init__(
        self, message: str, *, position: int | None = None, argument: int | None = None
    ) -> None:
        super().__init__(message)
        self.position = position
        self.argument = argument
