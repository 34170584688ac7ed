# SPDX-License-Identifier: BSD-3-Clause
"""Filter chains for grid maps, configured in YAML, and an expression language for layers.

A filter is called with a `GridMap` and returns a new `GridMap`. `FilterChain` builds a sequence of
filters from the YAML format of the C++ filters. `expression` implements the expression language.
`parts` provides helpers for fast custom filters. Only the executable `filter_chain` requires ROS.
"""

from grid_map_core_py._lazy import lazy_names

from ._chain import FilterChain
from ._filter import WHOLE_MAP, Filter, FilterWarning, in_map_order, warn
from ._offline import Filtered, filter_maps
from ._registry import FILTERS
from ._step import Step
from .errors import ExpressionError, FilterConfigError, FilterError
from .expression import Expression

__all__ = [
    "FILTERS",
    "WHOLE_MAP",
    "Expression",
    "ExpressionError",
    "Filter",
    "FilterChain",
    "FilterConfigError",
    "FilterError",
    "FilterWarning",
    "Filtered",
    "Step",
    "filter_maps",
    "in_map_order",
    "warn",
]

_, __getattr__, __dir__ = lazy_names(__name__, {".errors": "", ".expression": "", ".parts": ""})
