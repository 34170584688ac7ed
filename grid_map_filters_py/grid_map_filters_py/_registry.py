# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Filters by the type names that stand in YAML.

Third parties add theirs through the entry-point group `grid_map_filters_py.filters`: the name of
the entry point is the type, its object the filter class.
"""

from grid_map_core_py.plugins import Registry

from ._filter import Filter
from .builtin import (
    Bilateral,
    BufferNormalizer,
    ColorBlending,
    ColorFill,
    ColorMap,
    Curvature,
    Deletion,
    Dilation,
    Duplication,
    Erosion,
    GaussianBlur,
    Inpaint,
    LightIntensity,
    MathExpression,
    MeanInRadius,
    MedianFill,
    MinInRadius,
    NormalColorMap,
    NormalVectors,
    Roughness,
    SetBasicLayers,
    SlidingWindowMathExpression,
    Slope,
    StepHeight,
    Threshold,
    Traversability,
)

BUILT_IN: dict[str, type[Filter]] = {
    "gridMapCv/InpaintFilter": Inpaint,
    "gridMapFilters/BilateralFilter": Bilateral,
    "gridMapFilters/BufferNormalizerFilter": BufferNormalizer,
    "gridMapFilters/ColorBlendingFilter": ColorBlending,
    "gridMapFilters/ColorFillFilter": ColorFill,
    "gridMapFilters/ColorMapFilter": ColorMap,
    "gridMapFilters/CurvatureFilter": Curvature,
    "gridMapFilters/DeletionFilter": Deletion,
    "gridMapFilters/DilationFilter": Dilation,
    "gridMapFilters/DuplicationFilter": Duplication,
    "gridMapFilters/ErosionFilter": Erosion,
    "gridMapFilters/GaussianBlurFilter": GaussianBlur,
    "gridMapFilters/LightIntensityFilter": LightIntensity,
    "gridMapFilters/MathExpressionFilter": MathExpression,
    "gridMapFilters/MeanInRadiusFilter": MeanInRadius,
    "gridMapFilters/MedianFillFilter": MedianFill,
    "gridMapFilters/MinInRadiusFilter": MinInRadius,
    "gridMapFilters/NormalColorMapFilter": NormalColorMap,
    "gridMapFilters/NormalVectorsFilter": NormalVectors,
    "gridMapFilters/RoughnessFilter": Roughness,
    "gridMapFilters/SetBasicLayersFilter": SetBasicLayers,
    "gridMapFilters/SlidingWindowMathExpressionFilter": SlidingWindowMathExpression,
    "gridMapFilters/SlopeFilter": Slope,
    "gridMapFilters/StepHeightFilter": StepHeight,
    "gridMapFilters/ThresholdFilter": Threshold,
    "gridMapFilters/TraversabilityFilter": Traversability,
}

PREFIXES = ("gridMapFilters/", "gridMapCv/", "")
"""What may stand before the name of a built-in filter; the last is the short form."""


def _aliases(type_name: str) -> list[str]:
    """Return other spellings of a type: `gridMapFilters/XFilter`, `gridMapCv/XFilter`, `X`."""
    name = type_name.partition("/")[2]
    spellings = [prefix + name if prefix else name.removesuffix("Filter") for prefix in PREFIXES]
    return [spelling for spelling in spellings if spelling != type_name]


ALIASES: dict[str, type[Filter]] = {
    alias: filter_class
    for type_name, filter_class in BUILT_IN.items()
    for alias in _aliases(type_name)
}


class FilterRegistry(Registry[Filter]):
    """Finds filters by their aliases too, and lists each of them once."""

    @property
    def types(self) -> tuple[str, ...]:
        """All type names but aliases, sorted."""
        return tuple(name for name in super().types if name not in ALIASES)


FILTERS = FilterRegistry(BUILT_IN | ALIASES, "grid_map_filters_py.filters")
"""All filters: `FILTERS["Threshold"]`, also `FILTERS["gridMapFilters/ThresholdFilter"]`."""
