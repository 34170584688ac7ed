# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Filters by the type names that stand in YAML.

Third parties add theirs through the entry-point group `grid_map_filters_py.filters`: the name of
the entry point is the type, its object the filter class.
"""

import difflib
from collections.abc import Iterable
from functools import cache
from importlib.metadata import EntryPoint, entry_points

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
from .errors import FilterConfigError
from .filter import Filter

ENTRY_POINT_GROUP = "grid_map_filters_py.filters"

BUILTIN: dict[str, type[Filter]] = {
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


def filter_class(type_name: str) -> type[Filter]:
    """Return the class registered under a YAML type.

    Raises:
        FilterConfigError: there is none, it cannot be loaded, or several claim the name.
    """
    if type_name in BUILTIN and type_name not in _third_party():
        return BUILTIN[type_name]
    if type_name not in _third_party():
        raise FilterConfigError(f"unknown type {type_name!r}; {_suggestion(type_name)}")
    return _load(_third_party()[type_name])


def filter_types() -> tuple[str, ...]:
    """Return all registered types, sorted."""
    return tuple(sorted({*BUILTIN, *_third_party()}))


@cache
def _third_party() -> dict[str, EntryPoint]:
    return unique(entry_points(group=ENTRY_POINT_GROUP))


def unique(found: Iterable[EntryPoint]) -> dict[str, EntryPoint]:
    """Return entry points by name; raise where one takes the name of another filter."""
    by_name: dict[str, EntryPoint] = {}
    # A package that is installed in two places of the path shows the same entry point twice.
    for entry_point in dict.fromkeys(found):
        other = by_name.get(entry_point.name)
        if other is not None or entry_point.name in BUILTIN:
            owner = other.value if other is not None else "this package"
            raise FilterConfigError(
                f"type {entry_point.name!r} is registered by {owner} and by {entry_point.value}"
            )
        by_name[entry_point.name] = entry_point
    return by_name


def _load(entry_point: EntryPoint) -> type[Filter]:
    try:
        loaded: type[Filter] = entry_point.load()
    except Exception as error:
        raise FilterConfigError(
            f"type {entry_point.name!r}: cannot load {entry_point.value!r}: {error}"
        ) from error
    return loaded


def _suggestion(type_name: str) -> str:
    close = difflib.get_close_matches(type_name, filter_types(), n=3, cutoff=0.6)
    if close:
        return f"did you mean {' or '.join(close)}?"
    return f"available: {', '.join(filter_types())}"
