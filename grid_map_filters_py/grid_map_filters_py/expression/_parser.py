# SPDX-License-Identifier: BSD-3-Clause
"""Parser of expressions: converts text to a syntax tree."""

from functools import cache
from importlib.resources import files
from typing import Any, cast

from lark import Lark, Token, Transformer_NonRecursive, v_args
from lark.exceptions import UnexpectedInput, UnexpectedToken

from ._functions import FUNCTIONS
from ._nodes import Fault, Node

_HINTS = {
    "=": "assignment is not part of the language: an expression is only the value (equality is ==)",
    "'": '"\'" is not an operator: use transpose(m); names are quoted with "..."',
    "!": "'!' is not an operator: use 'm == 0' for not and '!=' for unequal",
    "~": "'~' is not an operator: use 'm == 0' for not and '!=' for unequal",
    "&": "'&' is not an operator: multiply conditions with '.*' for and",
    "|": "'|' is not an operator: use cwiseMax(a, b) of conditions for or",
    '"': "the quoted name has no closing '\"'",
    "{": "unexpected '{': matrices are written [1, 2; 3, 4]",
}

# Names of terminals in error messages; unnamed terminals are not listed.
_EXPECTED = {
    "NUMBER": "a value",
    "OPEN_INDEX": "an operator",
    "SIGN": "an operator",
    "RPAR": "')'",
    "RSQB": "']'",
    "COMMA": "','",
    "SEMICOLON": "';'",
}

_VALUE = ", expected a value"

# Hints for common mistakes, by the unexpected terminal after a complete value.
_MISPLACED = {
    "COMPARE": "comparisons cannot be chained: write (a < b) .* (b < c)",
    "COLON": "a range has at most first:step:last",
}


def parse(text: str) -> Node:
    """Return the root of the syntax tree; raise a Fault if the text is not an expression."""
    if not text.strip():
        raise Fault("the expression is empty", position=0)
    try:
        root: Node = _Builder().transform(_grammar().parse(text))
    except UnexpectedInput as error:
        raise _explain(error, text) from None
    return root


@cache
def _grammar() -> Lark:
    text = files(__package__).joinpath("_grammar.lark").read_text(encoding="utf-8")
    return Lark(text, parser="lalr", maybe_placeholders=False)


def _explain(error: UnexpectedInput, text: str) -> Fault:
    position = error.pos_in_stream
    if not isinstance(error, UnexpectedToken):
        found = text[position or 0]
        return Fault(_HINTS.get(found, f"unexpected {found!r}"), position=position)
    token: Token = cast(Any, error).token  # not declared in lark's types
    words = dict.fromkeys(word for name, word in _EXPECTED.items() if name in error.accepts)
    wanted = f", expected {' or '.join(words)}" if words else ""
    if "NUMBER" in error.accepts:
        wanted = _VALUE
    if token.type == "$END":
        return Fault(f"the expression ends too early{wanted}", position=len(text.rstrip()))
    if token.type in _MISPLACED and wanted != _VALUE:
        return Fault(_MISPLACED[token.type], position=position)
    if token == "*" and text[:position].endswith("*"):
        return Fault("'**' is not an operator: use '^'", position=position)
    return Fault(f"unexpected {str(token)!r}{wanted}", position=position)


@v_args(inline=True)
class _Builder(Transformer_NonRecursive[Token, Node]):
    def number(self, token: Token) -> Node:
        return _node("number", token, float(token))

    def name(self, token: Token) -> Node:
        return _node("end", token) if token == "end" else _node("name", token, str(token))

    def quoted(self, token: Token) -> Node:
        return _node("name", token, str(token)[1:-1])

    def all(self, token: Token) -> Node:
        return _node("all", token)

    def unary(self, operator: Token, operand: Node) -> Node:
        return _node("unary", operator, str(operator), operand)

    def binary(self, left: Node, operator: Token, right: Node) -> Node:
        return _node("binary", operator, str(operator), left, right)

    def range(self, first: Node, *others: Node) -> Node:
        step, last = others if len(others) == 2 else (None, *others)
        return _node("range", first, first, step, last)

    def row(self, *blocks: Node) -> tuple[Node, ...]:
        return blocks

    arguments = row

    def matrix(self, bracket: Token, *rows: tuple[Node, ...]) -> Node:
        return _node("matrix", bracket, *rows)

    def apply(self, base: Node, bracket: Token, arguments: tuple[Node, ...]) -> Node:
        if base.kind == "name" and base.parts[0] in FUNCTIONS:
            return _node("call", base, base.parts[0], arguments)
        return _node("index", base if base.kind == "name" else bracket, base, arguments)


def _node(kind: str, place: Token | Node, *parts: Any) -> Node:
    position = place.position if isinstance(place, Node) else place.start_pos or 0
    return Node(kind, parts, position)
