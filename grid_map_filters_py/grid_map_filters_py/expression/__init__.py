# SPDX-License-Identifier: BSD-3-Clause
"""The expression language of the filters (EigenLab's, with additions).

`Expression(text)` is parsed once. Called with layers it returns a matrix or a number; its method
`over_windows` evaluates it for the window around every cell.
"""

from ._expression import Expression

__all__ = ["Expression"]
