# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/FootprintFilter`"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from grid_map_core_py import GridMap, planning
from grid_map_core_py._arrays import Layer
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.planning._footprint import parsed_footprint
from grid_map_core_py.plugins import check

from ..parts._layer_filter import LayerFilter


@dataclass(frozen=True, kw_only=True)
class Footprint(LayerFilter):
    """Combine the values of the cells under the robot's footprint.

    The robot is placed at each cell center and rotated to `yaws` headings. `statistic` combines the
    cells under the footprint into one value per heading. `directions` combines the values of all
    headings. Non-finite cells and cells outside the map are unknown. A heading is unknown if the
    footprint touches an unknown cell.

    Attributes:
        input_layer: values, such as traversability.
        output_layer: layer for the result; NaN is unknown.
        footprint: corners [x, y] of the robot [m] in order along its outline; x points forward. The
            value is a list or, as in Nav2, a string.
        radius: radius of a round robot [m]; replaces `footprint`.
        yaws: number of headings, evenly spread over a full turn.
        statistic: how the cells under the footprint are combined. Use `min` or `mean` if high
            values are good, as for traversability. Use `max` if high values are bad, as for costs.
        directions: how headings are combined. `worst` gives the value of the worst heading, or NaN
            if a heading is unknown. `best` gives the value of the best known heading.
    """

    footprint: str | tuple[tuple[float, ...], ...] | None = None
    radius: float | None = None
    yaws: int = 16
    statistic: Literal["min", "mean", "max"] = "min"
    directions: Literal["worst", "best"] = "worst"

    def __post_init__(self) -> None:
        if (self.footprint is None) == (self.radius is None):
            raise ConfigError("expected exactly one of 'footprint' and 'radius'")
        check(self.yaws >= 1, "yaws", "a number of directions >= 1", self.yaws)
        _ = self._outline

    def reach(self, resolution: float) -> float:
        # The near border of the farthest cell is half a cell before its center.
        return math.ceil(min(self._outline.radius / resolution + 0.5, 2.0**31)) - 1

    @cached_property
    def _outline(self) -> planning.Footprint:
        if self.radius is None:
            return parsed_footprint(self.footprint)
        return planning.Footprint.circle(self.radius)

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        block = GridMap.from_array(layer, resolution, layer="values")
        found = planning.footprint_layer(block, self._outline, "values", self.yaws, self.statistic)
        is_worst = self.directions == "worst"
        # The first two pass NaN on, the others ignore it.
        lowest, highest = (np.minimum, np.maximum) if is_worst else (np.fmin, np.fmax)
        combine = lowest if is_worst == (self.statistic != "max") else highest
        return np.asarray(combine.reduce(found, axis=2))
