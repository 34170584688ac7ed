# SPDX-License-Identifier: BSD-3-Clause
"""Simulated robot that drives over terrain with obstacles, and its drifting odometry."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap, Interpolation
from grid_map_core_py.elevation import LaserModel, SensorModel, StructuredLightModel
from grid_map_core_py.simulation import DepthCamera, SpinningLidar, with_box, with_ramp, with_stairs

from .terrain import load_terrain

Matrix = npt.NDArray[np.float64]  # (4, 4) homogeneous transform: rotation and translation [m]

RESOLUTION = 0.05
RADII = (6.0, 4.5)  # semi-axes of the ellipse that the robot follows [m]
HEIGHT = 0.35  # height of the robot frame above the ground [m]
DRIFT = np.array([0.003, -0.002, 0.01])  # drift of the odometry along x, y, z [m/s]
WALK = 0.003  # standard deviation that the odometry reports along each axis after one second [m]

LIDAR = np.eye(4)
LIDAR[2, 3] = 0.45
"""Transform from the lidar to the robot frame; the lidar is above the middle of the robot."""


def camera_pose(tilt: float, *position: float) -> Matrix:
    """Return the pose (4, 4) of a camera that looks along +x, tilted down by `tilt` [rad]."""
    pose = np.eye(4)
    pose[:3, 0] = 0.0, -1.0, 0.0
    pose[:3, 1] = -math.sin(tilt), 0.0, -math.cos(tilt)
    pose[:3, 2] = math.cos(tilt), 0.0, -math.sin(tilt)
    pose[:3, 3] = position
    return pose


CAMERA = camera_pose(0.3, 0.3, 0.0, 0.3)
"""Transform from the camera to the robot frame; the camera looks ahead and down."""

SENSORS: dict[str, tuple[Matrix, npt.NDArray[np.float64], SensorModel]] = {
    "lidar": (LIDAR, SpinningLidar(azimuths=720).directions, LaserModel()),
    "camera": (CAMERA, DepthCamera().directions, StructuredLightModel()),
}
"""Sensors by frame name: transform to the robot frame, beam directions, and noise model."""

START, GOAL = (7.5, -2.5), (3.5, 6.0)
"""Start below the scarp of the terrain, and goal behind the cliff on the scarp [m]."""

MAX_RANGE = 5.0
"""Range of the sensors on the way to the goal [m]: less than from the start to the cliff."""

STRIDE = 0.4  # maximum distance that the robot walks after each map [m]

ARRIVED = 0.35
"""Distance from the goal at which the robot has arrived [m]; above the planner's tolerance."""


def load_course(path: Path) -> GridMap:
    """Return the enlarged demo terrain without holes, with obstacles on the robot's path."""
    ground = load_terrain(path, RESOLUTION, holes=False).without_layers(["color"])
    ground = with_stairs(ground, (4.0, 1.5), (1.6, 1.2), 0.6, 4, yaw=0.5 * math.pi)
    ground = with_ramp(ground, (7.7, 1.5), (2.4, 1.2), 0.5, yaw=0.5 * math.pi)
    for x, y, side, height in ((6.2, 4.1, 0.8, 0.6), (3.2, 2.9, 0.5, 1.2), (1.5, 5.9, 0.6, 0.3)):
        ground = with_box(ground, (x, y), (side, 0.6), height, yaw=0.3 * x)
    return ground


def load_cliff(path: Path) -> GridMap:
    """Return the demo terrain with walls at the borders and a cliff between `START` and `GOAL`."""
    ground = load_terrain(path, RESOLUTION, holes=False).without_layers(["color"])
    ground = with_box(ground, (4.6, 3.7), (5.4, 0.6), 1.0, yaw=0.54)
    heights = ground["elevation"]
    ground["elevation"] = np.pad(heights[10:-10, 10:-10], 10, constant_values=heights.max())
    return ground


@dataclass
class RobotCourse:
    """Positions of the robot and of a person, as functions of the time since the start."""

    ground: GridMap
    speed: float  # [m/s]

    def terrain_at(self, seconds: float) -> GridMap:
        """Return the terrain and the layer `person`: the person's height [m], NaN elsewhere."""
        # The person appears once per lap (54.4 s at 0.6 m/s).
        walk, terrain = seconds % 54.4 - 4.5, self.ground
        if 0.0 <= walk <= 2.5:
            terrain = with_box(terrain, (4.2 - 1.2 * walk, 4.6 - 0.2 * walk), (0.4, 0.3), 1.7)
        height = terrain["elevation"] - self.ground["elevation"]
        return terrain.with_layers({"person": np.where(height > 0.0, height, np.nan)})

    def pose_at(self, seconds: float) -> Matrix:
        angle = self.speed * seconds / math.sqrt(RADII[0] * RADII[1])
        x, y = RADII[0] * math.cos(angle), RADII[1] * math.sin(angle)
        way = np.array([-RADII[0] * math.sin(angle), RADII[1] * math.cos(angle)])
        return standing_pose(self.ground, np.array([x, y]), way / np.linalg.norm(way))


def standing_pose(ground: GridMap, position: Matrix, way: Matrix) -> Matrix:
    """Return the pose (4, 4) of a robot that stands perpendicular to the ground."""
    side = np.array([-way[1], way[0]])
    feet = position + 0.3 * np.array([way, -way, side, -side])
    heights = np.asarray(ground.at_position("elevation", feet, Interpolation.LINEAR))
    front, back, left, right = heights.tolist()
    forward = np.array([*way, (front - back) / 0.6])
    leftward = np.array([*side, (left - right) / 0.6])
    pose = np.eye(4)
    pose[:3, 0] = forward / np.linalg.norm(forward)
    up = np.cross(forward, leftward)
    pose[:3, 2] = up / np.linalg.norm(up)
    pose[:3, 1] = np.cross(pose[:3, 2], pose[:3, 0])
    pose[:3, 3] = *position, heights.mean() + HEIGHT
    return pose


def drifted(pose: Matrix, seconds: float) -> Matrix:
    """Return a pose shifted by the odometry drift after `seconds`."""
    reported = pose.copy()
    reported[:3, 3] += DRIFT * seconds
    return reported


def covariance_at(seconds: float) -> Matrix:
    """Return the covariance (6, 6) of the odometry, which grows with time."""
    return np.diag([WALK**2 * seconds] * 3 + [1e-6] * 3)


def truth_at(ground: GridMap, position: Matrix, length: float, seconds: float) -> GridMap:
    """Return a square of the true terrain around `position`, shifted into the odometry frame."""
    block = ground.get_submap(position, (length, length))
    block.position = block.position + DRIFT[:2] * seconds
    block["elevation"] += np.float32(DRIFT[2] * seconds)
    return block


class Walker:
    """Robot that starts at `START` and follows the latest plan.

    Attributes:
        position: (2,) position [m].
        way: (2,) unit vector of the heading.
        plan: (N, 2) positions of the plan that the robot has not reached yet [m].
    """

    def __init__(self) -> None:
        self.position = np.array(START)
        self.way = np.subtract(GOAL, START) / math.dist(GOAL, START)
        self.plan: Matrix = np.empty((0, 2))

    def follow(self, plan: Matrix) -> None:
        """Follow a new plan (N, 2) from its point nearest to the robot."""
        distances = np.hypot(*(plan - self.position).T)
        self.plan = plan[distances.argmin() :] if len(plan) else plan

    def walk(self, distance: float) -> None:
        while len(self.plan) and distance > 0.0:
            ahead = self.plan[0] - self.position
            length = float(np.hypot(*ahead))
            if length > 0.0:
                self.way = ahead / length
            self.position = self.position + min(length, distance) * self.way
            distance -= length
            if distance >= 0.0:
                self.plan = self.plan[1:]
