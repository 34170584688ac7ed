# SPDX-License-Identifier: BSD-3-Clause
"""Convert layers to and from navigation costmaps, which store one cost from 0 to 255 per cell."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Layer, as_number, as_numbers, as_pair, as_size
from .._arrays._pieces import elementwise
from ..errors import GeometryError, short
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap

Costs: TypeAlias = NDArray[np.uint8]
"""(...) uint8: costs from 0 to 254, or 255 for unknown."""

FREE = 0
INSCRIBED = 253
"""Cost of a cell where a robot collides at any heading if the robot's center is in the cell."""
LETHAL = 254
UNKNOWN = 255


class CostCodec(Protocol):
    """Interface for conversion between layer values and costs."""

    def to_costs(self, values: ArrayLike) -> Costs:
        """Convert values (...) to costs (...) uint8; NaN becomes 255."""

    def to_values(self, costs: ArrayLike) -> Layer:
        """Convert costs (...) uint8 to values (...) float32."""


@dataclass(frozen=True)
class CostTable:
    """Converts layer values to Nav2 costs: free (0), inscribed (253), lethal (254), unknown (255).

    Values between `free` and `inscribed` are mapped linearly to the costs 0 to 253. The defaults
    suit layers with occupancy values from 0 to 100 and -1 for unknown. For layers that store costs,
    use `CostTable(0, 253, 254, 255)`.

    Attributes:
        free: layer value that maps to cost 0.
        inscribed: layer value that maps to cost 253.
        lethal: layer value that maps to cost 254.
        unknown: layer value that maps to cost 255; may be NaN.

    Raises:
        GeometryError: `free`, `inscribed` and `lethal` are not in ascending order, or `unknown`
            equals the layer value of another cost.
    """

    free: float = 0.0
    inscribed: float = 99.0
    lethal: float = 100.0
    unknown: float = -1.0

    def __post_init__(self) -> None:
        for name in ("free", "inscribed", "lethal", "unknown"):
            object.__setattr__(self, name, as_number(getattr(self, name), name))
        values = self._values
        if not (np.isfinite(values[:UNKNOWN]).all() and (np.diff(values[:UNKNOWN]) > 0).all()):
            raise GeometryError(f"expected free < inscribed < lethal, all finite, got {self}")
        if np.float32(self.unknown) in values[:UNKNOWN]:
            raise GeometryError(
                f"unknown: expected a value that no known cost has, got {self.unknown:g}"
            )

    @property
    def _values(self) -> Layer:
        with np.errstate(over="ignore", invalid="ignore"):
            known = np.linspace(self.free, self.inscribed, LETHAL)
            return np.append(known, (self.lethal, self.unknown)).astype(np.float32)

    def to_costs(self, values: ArrayLike) -> Costs:
        """Convert values (...) to the nearest costs (...) uint8; NaN and `unknown` become 255."""
        return elementwise(self._costs, np.uint8, as_numbers(values, "values"))

    def to_values(self, costs: ArrayLike) -> Layer:
        """Convert costs (...) in [0, 255] to values (...) float32."""
        return elementwise(self._values.take, np.float32, _as_costs(costs))

    def _costs(self, values: NDArray[Any]) -> Costs:
        values = values.astype(np.float32)
        value_per_cost = np.float32((self.inscribed - self.free) / INSCRIBED)
        steps = (values - np.float32(self.free)) / value_per_cost
        # `fmax` turns NaN into free; the last line then sets these cells to unknown.
        nearest = np.rint(np.fmin(np.fmax(steps, FREE), INSCRIBED))
        costs: Costs = nearest.astype(np.uint8)
        costs[values >= 0.5 * (self.inscribed + self.lethal)] = LETHAL
        costs[np.isnan(values) | (values == np.float32(self.unknown))] = UNKNOWN
        return costs


@dataclass(frozen=True)
class CostRange:
    """Maps a range of values linearly to the costs 0 to 254, like the C++ conversion for nav2.

    Attributes:
        data_min: layer value that maps to cost 0.
        data_max: layer value that maps to cost 254; may be less than `data_min`.

    Raises:
        GeometryError: the bounds are not finite, or are equal as float32.
    """

    data_min: float = FREE
    data_max: float = LETHAL

    def __post_init__(self) -> None:
        for name in ("data_min", "data_max"):
            object.__setattr__(self, name, as_number(getattr(self, name), name))
        with np.errstate(over="ignore", invalid="ignore"):
            extent = self._extent
        if not np.isfinite(extent) or extent == 0:
            raise GeometryError(f"expected two different finite float32 numbers, got {self}")

    def to_costs(self, values: ArrayLike) -> Costs:
        """Convert values (...) to costs (...) uint8; NaN becomes 255.

        The cost is `trunc(254 * clamp((value - data_min) / (data_max - data_min), 0, 1))`, computed
        in float32 as in the C++ library.
        """
        return elementwise(self._costs, np.uint8, as_numbers(values, "values"))

    def to_values(self, costs: ArrayLike) -> Layer:
        """Convert costs (...) to float32 values from `data_min` to `data_max`; 255 becomes NaN."""
        known = self.data_min + float(self._extent) / LETHAL * np.arange(UNKNOWN)
        table = np.append(known, np.nan).astype(np.float32)
        return elementwise(table.take, np.float32, _as_costs(costs))

    @property
    def _extent(self) -> np.float32:
        return np.float32(self.data_max) - np.float32(self.data_min)

    def _costs(self, values: NDArray[Any]) -> Costs:
        share = values.astype(np.float32)
        share -= np.float32(self.data_min)
        share /= self._extent
        scaled = np.fmin(np.fmax(share, 0), 1) * np.float32(LETHAL)
        costs: Costs = scaled.astype(np.uint8)
        costs[np.isnan(share)] = UNKNOWN
        return costs


@dataclass(frozen=True, eq=False)
class Costmap:
    """A costmap with the attributes of nav2's `PyCostmap2D`.

    Attributes:
        costmap: (size_x * size_y,) uint8 costs in rows along +x; the first row has the smallest y.
        size_x, size_y: number of cells along x and y.
        resolution: side of a cell [m].
        origin_x, origin_y: position of the corner with the smallest x and y [m].
        global_frame_id: coordinate frame of the origin.
    """

    costmap: Costs
    size_x: int
    size_y: int
    resolution: float
    origin_x: float
    origin_y: float
    global_frame_id: str = ""


def to_costs(grid_map: GridMap, layer: str, codec: CostCodec) -> Costmap:
    """Convert a layer to a costmap.

    Args:
        codec: converts values to costs, such as a `CostTable` or `CostRange`.
    """
    costs = codec.to_costs(grid_map[layer])
    costs = np.roll(costs, np.negative(grid_map.start_index), axis=(0, 1))
    origin = grid_map.position - 0.5 * grid_map.length
    return Costmap(
        # The first cell of a costmap has the smallest x and y; that of a grid map has the largest.
        costmap=costs.ravel("F")[::-1].copy(),
        size_x=grid_map.size[0],
        size_y=grid_map.size[1],
        resolution=grid_map.resolution,
        origin_x=float(origin[0]),
        origin_y=float(origin[1]),
        global_frame_id=grid_map.frame_id,
    )


def from_costs(costmap: Costmap, layer: str, codec: CostCodec, *, timestamp: int = 0) -> GridMap:
    """Convert a costmap to a map with one layer.

    Args:
        costmap: a `Costmap`, or an object with the same attributes, such as `PyCostmap2D` in Nav2
            Kilted and later.
        codec: converts costs to values, such as a `CostTable` or `CostRange`.
        timestamp: time of the data [ns].

    Raises:
        GeometryError: the size or resolution is invalid, or the number of costs is wrong.
    """
    size = as_size((costmap.size_x, costmap.size_y), "size_x, size_y")
    costs = _as_costs(costmap.costmap)
    if costs.shape != (math.prod(size),):
        raise GeometryError(f"costmap: expected {size[0]} x {size[1]} costs, got {costs.shape}")
    resolution = as_number(costmap.resolution, "resolution")
    origin = as_pair((costmap.origin_x, costmap.origin_y), "origin_x, origin_y")
    center = np.array(origin) + 0.5 * resolution * np.array(size)
    geometry = GridGeometry.from_size(size, resolution, center)
    values = codec.to_values(costs[::-1].reshape(size, order="F"))
    return GridMap.from_geometry(
        geometry, frame_id=costmap.global_frame_id, timestamp=timestamp
    ).with_layers({layer: values})


def _as_costs(costs: ArrayLike) -> NDArray[Any]:
    array = as_numbers(costs, "costs")
    if array.dtype.kind not in "iu" or (array.size and (array.min() < 0 or array.max() > UNKNOWN)):
        raise GeometryError(f"costs: expected integers from 0 to {UNKNOWN}, got {short(costs)}")
    return array
