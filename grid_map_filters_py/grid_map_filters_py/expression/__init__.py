# SPDX-License-Identifier: BSD-3-Clause
"""Expression language of the filters: EigenLab syntax with additions.

`Expression(text)` parses the text once. Calling the expression with layers returns a matrix or a
number. The method `over_windows` evaluates the expression for the window around every cell.
"""

from grid_map_core_py import _lazy

from ._expression import Expression as Expression

__all__, __dir__ = _lazy.public_names(dir())
