# SPDX-License-Identifier: BSD-3-Clause
"""Simulated course with stairs, a ramp and stepping stones, and the camera poses along it."""

import math

from grid_map_core_py import GridMap
from grid_map_core_py.elevation import StructuredLightModel
from grid_map_core_py.simulation import DepthCamera, with_box, with_ramp, with_stairs

from .robot_course import Matrix, camera_pose

RISER, TREAD, STEPS, WIDTH = 0.17, 0.3, 5, 1.6
"""Height and depth of a step [m], number of steps, and width of stairs and ramp [m]."""

LANDING, RAMP = 0.8, 2.2  # lengths of the landing above the stairs, and of the ramp behind it [m]

FIRST, END = 1.0, 6.5
"""x of the first riser and of the last pose of the camera [m]; the first pose is at x = 0."""

TOP, FOOT = STEPS * RISER, FIRST + STEPS * TREAD + LANDING + RAMP
"""Height of the landing, and x of the foot of the ramp [m]."""

PLANES: dict[str, list[tuple[float, float]]] = {
    "treads": [(FIRST + (step + 0.5) * TREAD, 0.0) for step in range(STEPS)],
    "ramp": [(FOOT - 0.5 * RAMP, 0.0)],
    "stones": [(FOOT + 0.5 + 0.48 * k, 0.48 * side) for k in range(3) for side in (-1, 0, 1)],
}
"""Centers of the planes [m]; the highest tread is a part of the landing."""

NOISE, BEAMS, MAX_RANGE = StructuredLightModel(), DepthCamera(width=212, height=120).directions, 6.0


def make_course() -> GridMap:
    """Return a map of stairs, a landing, a ramp and stepping stones, with cells of 2 cm."""
    course = GridMap((10.0, 4.0), 0.02, (4.0, 0.0), layers={"elevation": 0.0}, frame_id="odom")
    depth, top = STEPS * TREAD, FIRST + STEPS * TREAD
    course = with_stairs(course, (top - 0.5 * depth, 0.0), (depth, WIDTH), TOP, STEPS)
    course = with_box(course, (top + 0.5 * LANDING, 0.0), (LANDING, WIDTH), TOP)
    course = with_ramp(course, PLANES["ramp"][0], (RAMP, WIDTH), TOP, yaw=math.pi)
    for number, center in enumerate(PLANES["stones"]):
        course = with_box(course, center, (0.32, 0.32), 0.1 + 0.05 * (number % 4))
    return course


def pose_at(x: float) -> Matrix:
    """Return the pose (4, 4) of the camera, which looks 60 degrees down from 2.2 m."""
    return camera_pose(math.radians(60.0), x, 0.0, 2.2)
