# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/BufferNormalizerFilter`"""

from dataclasses import dataclass

from grid_map_core_py import GridMap

from .._filter import CellFilter


@dataclass(frozen=True, kw_only=True)
class BufferNormalizer(CellFilter):
    """Reorder the data so that the start index is (0, 0).

    A `FilterChain` passes maps with the start index (0, 0) to its filters, and then restores the
    start index of the input. If a chain contains this filter or changes the size of the map, the
    result keeps the start index (0, 0).
    """

    def __call__(self, grid_map: GridMap) -> GridMap:
        return grid_map if grid_map.start_index == (0, 0) else grid_map.with_start_index((0, 0))
