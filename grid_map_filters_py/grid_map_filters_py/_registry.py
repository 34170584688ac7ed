# SPDX-License-Identifier: BSD-3-Clause
"""Registry of filters by YAML type name.

Other packages register filters through the entry-point group `grid_map_filters_py.filters`. The
name of an entry point is the YAML type of the filter, and its value refers to the filter class.
"""

from grid_map_core_py._parameters import with_checked_names
from grid_map_core_py.plugins import Registry

from . import _builtin
from ._filter import Filter

BUILT_IN: dict[str, type[Filter]] = {
    f"gridMap{'Cv' if name == 'Inpaint' else 'Filters'}/{name}Filter": with_checked_names(
        getattr(_builtin, name)
    )
    for name in _builtin.__all__
}
"""Built-in filters by C++ type name."""

ALIASES: dict[str, type[Filter]] = {
    alias: filter_class
    for type_name, filter_class in BUILT_IN.items()
    for name in [filter_class.__name__]
    for alias in (f"gridMapFilters/{name}Filter", f"gridMapCv/{name}Filter", name)
    if alias != type_name
}
"""Aliases of the built-in filters, such as "gridMapCv/SlopeFilter" and "Slope"."""


class FilterRegistry(Registry[Filter]):
    """Registry of filters by type or alias; `types` omits the aliases."""

    @property
    def types(self) -> tuple[str, ...]:
        """All type names without aliases, sorted."""
        return tuple(name for name in super().types if name not in ALIASES)


FILTERS = FilterRegistry(BUILT_IN | ALIASES, "grid_map_filters_py.filters")
"""All filters by type or alias, such as "gridMapFilters/ThresholdFilter" or "Threshold"."""
