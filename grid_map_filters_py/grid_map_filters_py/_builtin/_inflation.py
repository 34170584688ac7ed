# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/InflationFilter`"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from grid_map_core_py._arrays import Layer
from grid_map_core_py.conversions._costmap import INSCRIBED, LETHAL
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.planning._footprint import parsed_footprint
from grid_map_core_py.plugins import check
from grid_map_core_py.regions import Polygon

from .._filter import warn
from ..parts._layer_filter import LayerFilter, check_radius


@dataclass(frozen=True, kw_only=True)
class Inflation(LayerFilter):
    """Raise the costs around lethal cells (254) exactly as Nav2's inflation layer does.

    The cost depends on the distance d [m] from the center of the nearest lethal cell:

        d <= inscribed_radius: 253 (inscribed)
        otherwise: floor(252 exp(-cost_scaling_factor (d - inscribed_radius)))

    A known cell keeps its own cost if that is larger.

    Attributes:
        input_layer: costs from 0 to 254; non-finite cells are unknown.
        output_layer: layer for the result; NaN is unknown.
        inscribed_radius: radius [m] of the largest circle around the robot's origin that fits into
            the footprint. For a round robot without `footprint_padding`, use 0.9808 times
            `robot_radius`, because Nav2 replaces the circle with a polygon of 16 corners.
        footprint: corners [x, y] of the padded footprint [m]; replaces `inscribed_radius`. The
            value is a list or, as in Nav2, a string.
        inflation_radius: largest distance at which costs are raised [m], rounded up to whole cells.
        cost_scaling_factor: decay rate of costs beyond the inscribed radius [1/m].
        inflate_unknown: if true, unknown cells get all inflated costs. If false, only costs of 253
            and 254.
        inflate_around_unknown: treat unknown cells as lethal.
    """

    inscribed_radius: float | None = None
    footprint: str | tuple[tuple[float, ...], ...] | None = None
    inflation_radius: float = 0.55
    cost_scaling_factor: float = 10.0
    inflate_unknown: bool = False
    inflate_around_unknown: bool = False

    def __post_init__(self) -> None:
        if (self.inscribed_radius is None) == (self.footprint is None):
            raise ConfigError("expected exactly one of 'inscribed_radius' and 'footprint'")
        check_radius(self._inscribed_radius, "inscribed_radius")
        check_radius(self.inflation_radius, "inflation_radius")
        factor = self.cost_scaling_factor
        valid = math.isfinite(factor) and factor >= 0
        check(valid, "cost_scaling_factor", "a number >= 0 [1/m]", factor)

    def reach(self, resolution: float) -> float:
        # Like Nav2, round up without a tolerance. No map has more than 2**31 rows or columns.
        return math.ceil(min(self.inflation_radius / resolution, 2.0**31))

    @property
    def _inscribed_radius(self) -> float:
        if self.inscribed_radius is not None:
            return self.inscribed_radius
        start = parsed_footprint(self.footprint).points
        has_origin = bool(Polygon(start).is_inside((0.0, 0.0)))
        check(has_origin, "footprint", "an outline around the origin (0, 0)", self.footprint)
        along = np.roll(start, -1, axis=0) - start
        with np.errstate(invalid="ignore"):
            share = -(start * along).sum(axis=1) / (along**2).sum(axis=1)
        # Edges of zero length give NaN, which `fmax` replaces with 0.
        nearest = start + np.fmin(np.fmax(share, 0.0), 1.0)[:, None] * along
        return float(np.hypot(*nearest.T).min())

    def _for_blocks_of(self, layer: Layer) -> Callable[[Layer, float], Layer]:
        inscribed = self._inscribed_radius
        if self.inflation_radius < inscribed:
            warn(
                f"inflation_radius: expected at least the inscribed radius, {inscribed:g} m, got "
                f"{self.inflation_radius:g} m. Increase it, or the robot may touch obstacles"
            )
        return super()._for_blocks_of(layer)

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        unknown = ~np.isfinite(layer)
        costs = np.where(unknown, np.float32(0), layer)
        lethal = costs >= LETHAL
        if self.inflate_around_unknown:
            lethal |= unknown
        others = np.ascontiguousarray(~lethal.T).view(np.uint8)
        distances = cv2.distanceTransform(others, cv2.DIST_L2, cv2.DIST_MASK_PRECISE).T
        cells = math.ceil(min(self.reach(resolution), math.hypot(*layer.shape)))
        # Squared distances [cells^2] are integers, so rounding makes them exact. Without a lethal
        # cell, OpenCV returns a huge distance.
        squares = np.rint(np.square(np.minimum(distances, np.float32(cells + 1))))
        table = self._costs_by_square(cells, resolution)
        inflated = table.take(squares.astype(np.intp), mode="clip")
        least = 1 if self.inflate_unknown else INSCRIBED
        result: Layer = np.maximum(costs, inflated)
        result[unknown & (inflated < least)] = np.nan
        return result

    def _costs_by_square(self, cells: int, resolution: float) -> Layer:
        """Return the cost for each squared distance from 0 to `cells`^2 [cells^2], and 0 beyond."""
        beyond = np.sqrt(np.arange(cells**2 + 1.0)) * resolution - self._inscribed_radius
        costs = np.floor((INSCRIBED - 1) * np.exp(-self.cost_scaling_factor * np.fmax(beyond, 0)))
        costs[beyond <= 0] = INSCRIBED
        costs[0] = LETHAL
        return np.append(costs, 0).astype(np.float32)
