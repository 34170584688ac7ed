# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The syntax tree of an expression."""

from collections.abc import Iterator
from dataclasses import dataclass, fields


@dataclass(frozen=True, eq=False)
class Node:
    """Any part of an expression.

    Args:
        position: the column that its errors point at.
        structure: number of the part; equal parts have equal numbers, so that an evaluator computes
            them once.
    """

    position: int
    structure: int


@dataclass(frozen=True, eq=False)
class Number(Node):
    """A literal."""

    value: float


@dataclass(frozen=True, eq=False)
class Name(Node):
    """A layer or a named constant."""

    name: str


@dataclass(frozen=True, eq=False)
class End(Node):
    """`end`: the last index of the dimension that is being indexed."""


@dataclass(frozen=True, eq=False)
class All(Node):
    """A lone `:`: every index of the dimension."""


@dataclass(frozen=True, eq=False)
class Unary(Node):
    """`+operand` or `-operand`."""

    operator: str
    operand: Node


@dataclass(frozen=True, eq=False)
class Binary(Node):
    """`left operator right`, comparisons included."""

    operator: str
    left: Node
    right: Node


@dataclass(frozen=True, eq=False)
class Range(Node):
    """`first:last` or `first:step:last`, both ends included."""

    first: Node
    step: Node | None
    last: Node


@dataclass(frozen=True, eq=False)
class Matrix(Node):
    """`[a, b; c, d]`: blocks put side by side and rows on top of each other."""

    rows: tuple[tuple[Node, ...], ...]


@dataclass(frozen=True, eq=False)
class Index(Node):
    """`base(row, column)`, or `base(place)` on a vector."""

    base: Node
    arguments: tuple[Node, ...]


@dataclass(frozen=True, eq=False)
class Call(Node):
    """`function(arguments)` of a known function, unless a layer has that name: then an index."""

    function: str
    arguments: tuple[Node, ...]


def children(node: Node) -> Iterator[Node]:
    """Return the direct parts of `node` from left to right."""
    for field in fields(node):
        yield from _nodes_in(getattr(node, field.name))


def descendants(node: Node) -> Iterator[Node]:
    """Return `node` and everything below it."""
    yield node
    for child in children(node):
        yield from descendants(child)


def _nodes_in(value: object) -> Iterator[Node]:
    if isinstance(value, Node):
        yield value
    elif isinstance(value, tuple):
        for part in value:
            yield from _nodes_in(part)
