# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Filters by the type names that stand in YAML.

Third parties add theirs through the entry-point group `grid_map_filters_py.filters`: the name of
the entry point is the type, its object the filter class.
"""

from grid_map_core_py.registry import Registry

from .builtin.buffer_normalizer import BufferNormalizer
from .builtin.deletion import Deletion
from .builtin.duplication import Duplication
from .builtin.inpaint import Inpaint
from .builtin.math_expression import MathExpression
from .builtin.mean_in_radius import MeanInRadius
from .builtin.normal_color_map import NormalColorMap
from .builtin.normal_vectors import NormalVectors
from .builtin.sliding_window_math_expression import SlidingWindowMathExpression
from .builtin.threshold import Threshold
from .filter import Filter

BUILT_IN: dict[str, type[Filter]] = {
    "gridMapCv/InpaintFilter": Inpaint,
    "gridMapFilters/BufferNormalizerFilter": BufferNormalizer,
    "gridMapFilters/DeletionFilter": Deletion,
    "gridMapFilters/DuplicationFilter": Duplication,
    "gridMapFilters/MathExpressionFilter": MathExpression,
    "gridMapFilters/MeanInRadiusFilter": MeanInRadius,
    "gridMapFilters/NormalColorMapFilter": NormalColorMap,
    "gridMapFilters/NormalVectorsFilter": NormalVectors,
    "gridMapFilters/SlidingWindowMathExpressionFilter": SlidingWindowMathExpression,
    "gridMapFilters/ThresholdFilter": Threshold,
}

FILTERS: Registry[Filter] = Registry(BUILT_IN, "grid_map_filters_py.filters")
"""All filters: `FILTERS["gridMapFilters/ThresholdFilter"]`, `FILTERS.types`."""
