# SPDX-License-Identifier: BSD-3-Clause
"""Error classes of this package.

GridMapError (grid_map_core_py)
└── FilterError
    ├── FilterConfigError (ConfigError)    a chain that cannot be built
    └── ExpressionError (ValueError)       an expression that cannot be read or evaluated
"""

from grid_map_core_py.errors import ConfigError, GridMapError

__all__ = ["ExpressionError", "FilterConfigError", "FilterError"]


class FilterError(GridMapError):
    """A filter or its chain failed; the message names filter and cause."""


class FilterConfigError(FilterError, ConfigError):
    """A filter chain cannot be built from its configuration."""


class ExpressionError(FilterError, ValueError):
    """A mathematical expression is malformed or does not fit the layers it is applied to."""
