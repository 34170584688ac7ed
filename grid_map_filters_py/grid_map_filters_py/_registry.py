# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Filters by the type names in YAML.

Other packages add theirs through the entry-point group `grid_map_filters_py.filters`: the name of
the entry point is the type, its object the filter class.
"""

from grid_map_core_py.plugins import Registry

from . import builtin
from ._filter import Filter

BUILT_IN: dict[str, type[Filter]] = {
    "gridMapCv/InpaintFilter": builtin.Inpaint,
    "gridMapFilters/BilateralFilter": builtin.Bilateral,
    "gridMapFilters/BufferNormalizerFilter": builtin.BufferNormalizer,
    "gridMapFilters/ColorBlendingFilter": builtin.ColorBlending,
    "gridMapFilters/ColorFillFilter": builtin.ColorFill,
    "gridMapFilters/ColorMapFilter": builtin.ColorMap,
    "gridMapFilters/CurvatureFilter": builtin.Curvature,
    "gridMapFilters/DeletionFilter": builtin.Deletion,
    "gridMapFilters/DilationFilter": builtin.Dilation,
    "gridMapFilters/DuplicationFilter": builtin.Duplication,
    "gridMapFilters/ErosionFilter": builtin.Erosion,
    "gridMapFilters/GaussianBlurFilter": builtin.GaussianBlur,
    "gridMapFilters/LightIntensityFilter": builtin.LightIntensity,
    "gridMapFilters/MathExpressionFilter": builtin.MathExpression,
    "gridMapFilters/MeanInRadiusFilter": builtin.MeanInRadius,
    "gridMapFilters/MedianFillFilter": builtin.MedianFill,
    "gridMapFilters/MinInRadiusFilter": builtin.MinInRadius,
    "gridMapFilters/NormalColorMapFilter": builtin.NormalColorMap,
    "gridMapFilters/NormalVectorsFilter": builtin.NormalVectors,
    "gridMapFilters/RoughnessFilter": builtin.Roughness,
    "gridMapFilters/SetBasicLayersFilter": builtin.SetBasicLayers,
    "gridMapFilters/SlidingWindowMathExpressionFilter": builtin.SlidingWindowMathExpression,
    "gridMapFilters/SlopeFilter": builtin.Slope,
    "gridMapFilters/StepHeightFilter": builtin.StepHeight,
    "gridMapFilters/ThresholdFilter": builtin.Threshold,
    "gridMapFilters/TraversabilityFilter": builtin.Traversability,
}

PREFIXES = ("gridMapFilters/", "gridMapCv/", "")
"""Prefixes of the type of a built-in filter; the last one is the short form."""


def _aliases(type_name: str) -> set[str]:
    """Return the other spellings of a type `a/XFilter`, among them its short form `X`."""
    name = type_name.partition("/")[2]
    short = name.removesuffix("Filter")
    return {prefix + (name if prefix else short) for prefix in PREFIXES} - {type_name}


ALIASES: dict[str, type[Filter]] = {
    alias: filter_class
    for type_name, filter_class in BUILT_IN.items()
    for alias in _aliases(type_name)
}


class FilterRegistry(Registry[Filter]):
    """Finds filters by their aliases too, and lists each filter once."""

    @property
    def types(self) -> tuple[str, ...]:
        """All type names but aliases, sorted."""
        return tuple(name for name in super().types if name not in ALIASES)


FILTERS = FilterRegistry(BUILT_IN | ALIASES, "grid_map_filters_py.filters")
"""All filters: `FILTERS["Threshold"]`, also `FILTERS["gridMapFilters/ThresholdFilter"]`."""
