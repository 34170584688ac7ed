# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Errors in expressions, with a caret at the place of the error."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..errors import ExpressionError


class Fault(Exception):
    """An error in an expression; the node that is evaluated adds the position.

    Args:
        message: one line for the user.
        position: column in the text; None while unknown.
        argument: index of the function's argument that caused the fault, if one did.
    """

    def __init__(
        self, message: str, *, position: int | None = None, argument: int | None = None
    ) -> None:
        super().__init__(message)
        self.message = message
        self.position = position
        self.argument = argument

    def located(self, position: int) -> "Fault":
        """Return this fault with a position; the innermost one wins."""
        return self if self.position is not None else Fault(self.message, position=position)


@contextmanager
def faults_as_errors(text: str) -> Iterator[None]:
    """Turn faults into errors that show the expression with a caret under the place.

    Infinities and NaN raise no warnings meanwhile.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except Fault as fault:
        line = "".join(" " if character.isspace() else character for character in text)
        caret = " " * (fault.position or 0) + "^"
        raise ExpressionError(f"{fault.message}\n    {line}\n    {caret}") from None
