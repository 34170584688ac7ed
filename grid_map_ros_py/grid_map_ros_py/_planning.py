# SPDX-License-Identifier: BSD-3-Clause
"""Plans for the node `path_planner`: settings, error codes of Nav2, and plans on one map."""

import math
from ast import literal_eval
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py._arrays._checks import Mask
from grid_map_core_py._parameters import mismatch
from grid_map_core_py.errors import GeometryError, GridMapError
from grid_map_core_py.planning import Footprint, NoPathError, SlopeLimits, TravelGraph
from grid_map_core_py.plugins import check

from .messages._fields import Matrix, to_stamp
from .messages._packages import messages_of

Pose = tuple[float, float, float]
"""Pose x, y [m] and yaw [rad] in the frame of the map."""

Poses = npt.NDArray[np.float64]
"""(N, 4) poses of a plan: x, y, z [m] and yaw [rad], in the frame of the map."""

UNKNOWN, TF_ERROR, TIMEOUT = 200, 202, 207
"""Error codes of `nav2_msgs/ComputePathToPose`, besides those of `PathFailure`."""


class PlanError(GridMapError):
    """A plan cannot be made; `code` is an error code of `nav2_msgs/ComputePathToPose`."""

    def __init__(self, code: int, text: str) -> None:
        self.code = code
        super().__init__(text)


def code_of(error: Exception) -> int:
    """Return the error code of `nav2_msgs/ComputePathToPose` for an error."""
    if isinstance(error, NoPathError):
        return int(error.reason)
    return error.code if isinstance(error, PlanError) else UNKNOWN


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """Parameters that can be changed while the node runs.

    Attributes:
        cost_layer: layer with costs from 0 to 254; NaN means unknown. If empty, only lengths,
            slopes and steps count.
        cost_weight: a path through cost 252 counts as `1 + cost_weight` times its length.
        lethal: smallest cost that blocks a cell.
        elevation_layer: layer with heights [m]; cells without a height are blocked. If empty, the
            ground counts as flat.
        max_slope_up: largest slope at which the robot climbs [rad]; 0 means no limit.
        max_slope_down: largest slope at which the robot descends [rad]; 0 means no limit.
        max_slope_cross: largest slope across the path [rad]; 0 means no limit.
        max_step: largest height difference between neighboring cells [m]; 0 means no limit.
        footprint: corners of the robot in `base_frame` [m], as in Nav2: `[[x, y], ...]`; empty
            means a circle with `robot_radius`.
        robot_radius: radius of the robot [m] if `footprint` is empty; 0 means a point.
        neighbors: number of directions in which paths leave a cell.
        unknown: `blocked`, or `free` (cost 0).
        tolerance: maximum distance from the goal to the end of the plan if the goal is blocked [m].
        base_frame: frame of the robot; used with tf.
        stale_after: time without a usable map after which no plans are sent [s]; 0 means never.
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
        for name in ("cost_weight", "max_step", "robot_radius", "tolerance", "stale_after"):
            value = getattr(self, name)
            check(0 <= value < math.inf, name, "a number of at least 0", value)
        for name in ("max_slope_up", "max_slope_down", "max_slope_cross"):
            value = getattr(self, name)
            check(0 <= value <= 0.5 * math.pi, name, "radians from 0 to pi / 2", value)
        check(self.lethal > 0, "lethal", "a positive number", self.lethal)
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
        if not self.footprint:
            return Footprint.circle(self.robot_radius) if self.robot_radius else None
        try:
            return Footprint(literal_eval(self.footprint))
        except (GeometryError, SyntaxError, TypeError, ValueError) as error:
            expected = "corners [x, y] [m] of a polygon, [[x, y], ...]"
            raise mismatch("footprint", expected, self.footprint) from error

    @property
    def slopes(self) -> SlopeLimits | None:
        """The slope limits; None if there are none."""
        limits = self.max_slope_up, self.max_slope_down, self.max_slope_cross
        if not any(limits):
            return None
        up, down, cross = (limit or 0.5 * math.pi for limit in limits)
        return SlopeLimits(up=up, down=down, cross=cross)


class Planner:
    """Plans on one map with fixed settings; the graph is built when it is first used."""

    def __init__(self, grid_map: GridMap, settings: PlannerSettings) -> None:
        self.grid_map, self._settings = grid_map, settings

    @cached_property
    def _graph(self) -> TravelGraph:
        settings = self._settings
        return TravelGraph(
            self.grid_map,
            cost=settings.cost_layer or None,
            cost_weight=settings.cost_weight,
            lethal=settings.lethal if settings.cost_layer else None,
            elevation=settings.elevation_layer or None,
            limits=settings.slopes,
            max_step=settings.max_step or None,
            footprint=settings.body,
            neighbors=settings.neighbors,
            unknown=settings.unknown,
        )

    @property
    def frame_id(self) -> str:
        """Frame of the map."""
        return self.grid_map.frame_id

    def plan(self, start: Pose, goal: Pose, tolerance: float) -> Poses:
        """Return a plan, whose poses are at most 2.3 cells apart.

        Args:
            start, goal: x, y [m] and yaw [rad].
            tolerance: maximum distance from the goal to the end of the plan [m].

        Raises:
            NoPathError: there is no path.
        """
        path = self._graph.path(start, goal, tolerance=tolerance)
        return np.column_stack([path.positions, path.heights, path.yaws])

    def blocked(self, poses: Poses) -> Mask:
        """Return which poses (N,) are not on a free cell, or not free to reach from the last one.

        The straight line from one pose to the next must obey all limits. This is stricter than the
        moves of the graph: some moves of a new plan may count as blocked.
        """
        ground = self._graph._ground
        inside = np.asarray(self.grid_map.is_inside(poses[:, :2]))
        points = ground.to_points(poses[:, :2])
        ways = np.flatnonzero(inside[:-1] & inside[1:] & np.diff(points).any(axis=0))
        blocked = ~inside
        if len(ways):
            costs, _ = ground.straight(points[:, ways], points[:, ways + 1])
            blocked[ways[np.isinf(costs)] + 1] = True
        return blocked | self.occupied(poses)

    def occupied(self, poses: Poses) -> Mask:
        """Return which poses (N,) are outside the map or on a cell that is not free."""
        ground, graph = self._graph._ground, self._graph
        inside = np.asarray(self.grid_map.is_inside(poses[:, :2]))
        cells = ground.flat(*np.rint(ground.to_points(poses[inside, :2])).astype(np.intp))
        occupied = ~inside
        occupied[inside] = ~graph._free[cells]
        return occupied

    def cost_to_go(self, goal: npt.NDArray[np.float64]) -> GridMap:
        """Return the map with the layer `cost_to_go`: least cost to a goal (x, y, ...) [m].

        The layer is infinite where there is no path.
        """
        field = self._graph.cost_to(goal[None, :2])
        return self.grid_map.with_layers({"cost_to_go": field.costs})


def yaw_of(matrix: Matrix) -> float:
    """Return the yaw [rad] of a (4, 4) transform."""
    return math.atan2(matrix[1, 0], matrix[0, 0])


def to_path(poses: Poses, frame_id: str, stamp: int) -> Any:
    """Convert a plan to `nav_msgs/Path`; `stamp` is its time [ns]."""
    geometry = messages_of("geometry_msgs")
    header = messages_of("std_msgs").Header(stamp=to_stamp(stamp), frame_id=frame_id)
    path = messages_of("nav_msgs").Path(header=header)
    for x, y, z, yaw in poses.tolist():
        turn = geometry.Quaternion(z=math.sin(0.5 * yaw), w=math.cos(0.5 * yaw))
        pose = geometry.Pose(position=geometry.Point(x=x, y=y, z=z), orientation=turn)
        path.poses.append(geometry.PoseStamped(header=header, pose=pose))
    return path
