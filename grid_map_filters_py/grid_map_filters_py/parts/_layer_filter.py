# SPDX-License-Identifier: BSD-3-Clause
"""Base classes of filters that compute one layer, and gray-scale dilation and erosion."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer
from grid_map_core_py.plugins import check

from .._filter import WHOLE_MAP, CellFilter, in_map_order
from ._blocks import blockwise
from ._disc import Disc, disc_reach, need_neighbors, typical_value

Values: TypeAlias = npt.NDArray[np.floating[Any]]


@dataclass(frozen=True, kw_only=True)
class LayerFilter(ABC):
    """Base class for filters that compute one layer from another.

    Attributes:
        input_layer: layer to filter.
        output_layer: layer for the result.
    """

    input_layer: str
    output_layer: str

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        layer, resolution = grid_map[self.input_layer], grid_map.resolution
        function = self._for_blocks_of(layer)
        # Cellwise filters process the layer in parts themselves, and write each part only once.
        reach = WHOLE_MAP if isinstance(self, CellFilter) else self.reach(resolution)
        result = blockwise(lambda block: function(block, resolution), layer, reach=reach)
        return grid_map.with_layers({self.output_layer: result})

    @abstractmethod
    def reach(self, resolution: float) -> float:
        """Return the reach of the filter; see `LocalFilter.reach`."""

    def _for_blocks_of(self, _layer: Layer) -> Callable[[Layer, float], Values]:
        """Return a function that filters one block, given the block and the resolution."""
        return self._filter

    @abstractmethod
    def _filter(self, layer: Layer, resolution: float) -> Values:
        """Return the filtered layer; `layer` is in map order and must not be changed."""


@dataclass(frozen=True, kw_only=True)
class AroundTypicalValue(LayerFilter):
    """Base class for filters that subtract a typical value of the layer to preserve precision."""

    def _for_blocks_of(self, layer: Layer) -> Callable[[Layer, float], Values]:
        return partial(self._filter_around, typical_value(layer))

    def _filter(self, layer: Layer, resolution: float) -> Values:
        return self._filter_around(typical_value(layer), layer, resolution)

    @abstractmethod
    def _filter_around(self, offset: float, layer: Layer, resolution: float) -> Values:
        """Return the filtered layer, computed from differences to `offset`."""


@dataclass(frozen=True, kw_only=True)
class DiscFilter(LayerFilter):
    """Base class for filters that use the disc around each cell.

    Attributes:
        radius: radius of the disc [m], including its edge; 0 or more.
    """

    radius: float

    def __post_init__(self) -> None:
        check_radius(self.radius)

    def __call__(self, grid_map: GridMap) -> GridMap:
        need_neighbors(self.radius, grid_map.resolution)
        return super().__call__(grid_map)

    def reach(self, resolution: float) -> float:
        return disc_reach(self.radius, resolution)


@dataclass(frozen=True, kw_only=True)
class FillingDiscFilter(DiscFilter):
    """Base class for disc filters that can also fill holes.

    Attributes:
        compute_empty_cells: also fill non-finite cells whose disc contains a finite value.
    """

    compute_empty_cells: bool = False


def check_radius(radius: float, name: str = "radius") -> None:
    """Raise an error unless `radius` is finite and >= 0; `name` is the parameter name."""
    check(math.isfinite(radius) and radius >= 0, name, "a length >= 0 [m]", radius)


def highest_in_disc(layer: Layer, radius: float, resolution: float, *, fill: bool = True) -> Layer:
    """Return the largest finite value in the disc around every cell; NaN if there is none.

    Unless `fill` is True, non-finite cells become NaN. `radius` is in meters.
    """
    finite = np.isfinite(layer)
    known = np.where(finite, layer, np.float32(-np.inf))
    kernel = Disc(radius, resolution, layer.shape).kernel
    element = np.ascontiguousarray(kernel.T, dtype=np.uint8)
    highest = cv2.dilate(known.T, element, borderType=cv2.BORDER_CONSTANT, borderValue=-np.inf)
    highest[np.isneginf(highest) if fill else ~finite.T] = np.nan
    return np.asarray(highest.T, dtype=np.float32)


def lowest_in_disc(layer: Layer, radius: float, resolution: float, *, fill: bool = True) -> Layer:
    """Return the smallest finite value in the disc around every cell; see `highest_in_disc`."""
    return -highest_in_disc(-layer, radius, resolution, fill=fill)
