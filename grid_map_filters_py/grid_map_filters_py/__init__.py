# SPDX-License-Identifier: BSD-3-Clause
"""Chains of grid map filters, configured in YAML, and an expression language over layers; no ROS.

A filter takes a `GridMap` and returns another. `FilterChain` builds a sequence of them from the
YAML that the C++ filters read. `expression` has the expression language, `parts` has helpers for
fast filters of your own. The executable `filter_chain` runs a chain on a topic; it alone needs ROS.
"""

from ._chain import FilterChain
from ._filter import WHOLE_MAP, Filter, FilterWarning, in_map_order, warn
from ._offline import (
    Filtered,
    filter_maps,
)
from ._registry import FILTERS
from ._step import Step
from .errors import ExpressionError, FilterConfigError, FilterError
from .expression import Expression

__version__ = "0.2.0"

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
