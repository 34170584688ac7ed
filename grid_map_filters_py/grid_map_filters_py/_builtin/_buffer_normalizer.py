# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/BufferNormalizerFilter`"""

from dataclasses import dataclass

from grid_map_core_py import GridMap

from .._filter import CellFilter


@dataclass(frozen=True, kw_only=True)
class BufferNormalizer(CellFilter):
    """Reorder the data so that the start index is (0, 0).

    A `FilterChain` always passes maps with start index (0, 0) to its filters. The chain then
    restores the start index of the input, unless it contains this filter or changes the size.
    """

    def __call__(self, grid_map: GridMap) -> GridMap:
        return grid_map if grid_map.start_index == (0, 0) else grid_map.with_start_index((0, 0))
