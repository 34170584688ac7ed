# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the `path_planner` node, and checks of plans on one map."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py._arrays._checks import Mask, Positions
from grid_map_core_py._parameters import mismatch
from grid_map_core_py.planning import Footprint, SlopeLimits, TravelGraph
from grid_map_core_py.planning._footprint import LEAST_WIDTH, parsed_footprint
from grid_map_core_py.plugins import check


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """Parameters that can be changed while the node runs.

    Attributes:
        cost_layer: layer with costs from 0 to 254; NaN means unknown. Empty means no costs.
        cost_weight: weight of costs. Each meter at cost 252 counts as `1 + cost_weight` meters.
        lethal: smallest cost that blocks a cell.
        elevation_layer: layer with heights [m]; NaN blocks a cell. Empty means flat ground.
        max_slope_up: largest upward slope [rad]; 0 means no limit.
        max_slope_down: largest downward slope [rad]; 0 means no limit.
        max_slope_cross: largest slope across the path [rad]; 0 means no limit.
        max_step: largest step between neighboring cells [m]; 0 means no limit.
        footprint: corners of the robot in `base_frame` [m], as in Nav2: `[[x, y], ...]`.
        robot_radius: radius of the robot [m] if `footprint` is empty; 0 means a point.
        neighbors: number of directions in which paths can leave a cell.
        unknown: treatment of cells whose cost is NaN; `free` means cost 0.
        tolerance: maximum distance from a blocked goal to the end of the plan [m].
        base_frame: tf2 frame of the robot. If empty, or without tf2, plans start at `initial_pose`.
        stale_after: time without a usable map after which planning fails [s]; 0 means no limit.
    """

    cost_layer: str = "cost"
    cost_weight: float = 1.0
    lethal: float = 253.0
    elevation_layer: str = "elevation"
    max_slope_up: float = 0.0
    max_slope_down: float = 0.0
    max_slope_cross: float = 0.0
    max_step: float = 0.0
    footprint: str = ""
    robot_radius: float = 0.0
    neighbors: Literal[8, 16] = 16
    unknown: Literal["blocked", "free"] = "blocked"
    tolerance: float = 0.0
    base_frame: str = "base_link"
    stale_after: float = 10.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name.startswith("max_slope_"):
                check(0 <= value <= 0.5 * math.pi, name, "radians from 0 to pi / 2", value)
            elif isinstance(value, float):
                check(0 <= value < math.inf, name, "a number of at least 0", value)
        radius, expected = self.robot_radius, f"0, or a length > {LEAST_WIDTH:g} [m]"
        check(radius == 0 or radius > LEAST_WIDTH, "robot_radius", expected, radius)
        steepness = self.max_slope_up, self.max_slope_down, self.max_slope_cross, self.max_step
        if not self.elevation_layer and (any(steepness) or not self.cost_layer):
            expected = "a layer, as there are limits for slopes or steps, or no cost_layer"
            raise mismatch("elevation_layer", expected, "")
        _ = self.body  # Parse the footprint.

    @property
    def layers(self) -> list[str]:
        """Layers that a map must have."""
        return [*filter(None, dict.fromkeys((self.cost_layer, self.elevation_layer)))]

    @cached_property
    def body(self) -> Footprint | None:
        """The footprint of the robot; None if it is a point."""
        if self.footprint:
            return parsed_footprint(self.footprint)
        return Footprint.circle(self.robot_radius) if self.robot_radius else None


class Planner:
    """A map and its graph for path planning; the graph is built on first use."""

    def __init__(self, grid_map: GridMap, settings: PlannerSettings) -> None:
        self.grid_map, self._settings = grid_map, settings

    @cached_property
    def graph(self) -> TravelGraph:
        settings = self._settings
        slopes = settings.max_slope_up, settings.max_slope_down, settings.max_slope_cross
        return TravelGraph(
            self.grid_map,
            cost=settings.cost_layer or None,
            cost_weight=settings.cost_weight,
            lethal=settings.lethal if settings.cost_layer else None,
            elevation=settings.elevation_layer or None,
            limits=SlopeLimits(*(one or 0.5 * math.pi for one in slopes)) if any(slopes) else None,
            max_step=settings.max_step or None,
            footprint=settings.body,
            neighbors=settings.neighbors,
            unknown=settings.unknown,
        )

    def blocked(self, positions: Positions) -> Mask:
        """Return a mask (N,) of the blocked and unreachable positions of a plan (N, 2) [m].

        A position is reachable from the previous one if both are in the same free cell, if the
        graph has a move between their cells, or if the straight line between them obeys all limits.
        """
        graph, ground = self.graph, self.graph._ground
        cells, inside = self.grid_map.geometry.cells_at(positions)
        index = ground.flat(*cells)
        # A line of a plan may pass a cell at whose center the footprint is not free.
        blocked: Mask = ~(inside & (ground.passable if len(index) > 1 else graph._free)[index])
        points = ground.to_points(positions)
        before, after = index[:-1], index[1:]
        is_way = (before != after) | ~graph._free[before]
        (ways,) = np.nonzero(is_way & ~(blocked[:-1] | blocked[1:]))
        if len(ways):
            is_free = np.asarray(graph._matrix[after[ways], before[ways]]).ravel() > 0.0
            is_free |= np.isfinite(ground.straight(points[:, ways], points[:, ways + 1])[0])
            blocked[ways[~is_free] + 1] = True
        return blocked
