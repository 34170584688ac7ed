# SPDX-License-Identifier: BSD-3-Clause
"""Error classes of this package. Parentheses contain additional base classes.

GridMapError of grid_map_core_py
└── FilterError
    ├── FilterConfigError (ConfigError)    the chain cannot be built
    └── ExpressionError (ValueError)       the expression cannot be parsed or evaluated
"""

from grid_map_core_py.errors import ConfigError, GridMapError

__all__ = ["ExpressionError", "FilterConfigError", "FilterError"]


class FilterError(GridMapError):
    """A filter or a filter chain failed; the message names the filter and the cause."""


class FilterConfigError(FilterError, ConfigError):
    """A filter chain cannot be built from its configuration."""


class ExpressionError(FilterError, ValueError):
    """An expression is malformed, or does not fit the layers."""
