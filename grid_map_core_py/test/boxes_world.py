# SPDX-License-Identifier: BSD-3-Clause
"""Boxes on a plane whose true heights are known, and the noisy points of a sensor among them."""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class World:
    """The plane `z = slope * x` and boxes along the axes.

    Attributes:
        boxes: (B, 6) x0, x1, y0, y1, z0, z1 of each box [m]; one with z0 > 0 is a table top.
        slope: rise of the plane along x.
    """

    boxes: np.ndarray | tuple = ()
    slope: float = 0.0

    @property
    def limits(self):
        """(B, 3, 2) lower and upper limit of each box along x, y, z [m]."""
        return np.asarray(self.boxes, np.float64).reshape(-1, 3, 2)


def height_at(world, x, y):
    """Return the true height of the highest surface at places x, y, arrays of one shape [m]."""
    x, y = (np.asarray(values, np.float64)[..., None] for values in (x, y))
    (x0, x1), (y0, y1), (_, tops) = world.limits.transpose(1, 2, 0)
    inside = (x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1)
    heights = np.where(inside, tops, -np.inf)
    return np.maximum(world.slope * x[..., 0], heights.max(axis=-1, initial=-np.inf))


def ranges_of(world, origin, directions):
    """Return the ranges (N,) of beams (N, 3) of length 1 from a point (3,); inf for no hit."""
    with np.errstate(divide="ignore", invalid="ignore"):
        fall = world.slope * directions[:, 0] - directions[:, 2]
        ground = (origin[2] - world.slope * origin[0]) / fall
        ground[~(ground > 0.0)] = np.inf
        # The slab method: a beam is inside a box where it is between all three pairs of faces.
        enters, leaves = -np.inf, np.inf
        for axis in range(3):
            faces = (world.limits[:, axis] - origin[axis])[:, :, None] / directions[:, axis]
            enters = np.fmax(enters, np.fmin(faces[:, 0], faces[:, 1]))
            leaves = np.fmin(leaves, np.fmax(faces[:, 0], faces[:, 1]))
    enters[~((enters <= leaves) & (enters > 0.0))] = np.inf
    return np.minimum(ground, enters.min(axis=0, initial=np.inf))


def measured(
    world, directions, pose, random, *, along=0.018, across=(0.0015, 0.0006), max_range=20.0
):
    """Return the noisy points (n, 3) that a sensor measures, sensor frame [m].

    Args:
        world: the world.
        directions: (N, 3) of the beams, sensor frame.
        pose: (4, 4) of the sensor in the world.
        random: source of the noise.
        along: standard deviation along the beam [m], or a function of ranges (n,) that returns it.
        across: the same across the beam [m], at range 0 and its growth per meter.
        max_range: range from which on a beam does not return [m].
    """
    beams = directions / np.linalg.norm(directions, axis=1)[:, None]
    ranges = ranges_of(world, pose[:3, 3], beams @ pose[:3, :3].T)
    returned = ranges < max_range
    beams, ranges = beams[returned], ranges[returned, None]
    noise = random.standard_normal(beams.shape) * (across[0] + across[1] * ranges)
    noise -= (noise * beams).sum(axis=1)[:, None] * beams
    deviation = along(ranges) if callable(along) else along
    return (ranges + random.standard_normal(ranges.shape) * deviation) * beams + noise


def pose_of(position, roll=0.0, pitch=0.0):
    """Return the pose (4, 4) at a position (3,): first `roll` about x, then `pitch` about y."""
    (sin_r, cos_r), (sin_p, cos_p) = ((math.sin(a), math.cos(a)) for a in (roll, pitch))
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[cos_p, 0.0, sin_p], [0.0, 1.0, 0.0], [-sin_p, 0.0, cos_p]]) @ (
        np.array([[1.0, 0.0, 0.0], [0.0, cos_r, -sin_r], [0.0, sin_r, cos_r]])
    )
    matrix[:3, 3] = position
    return matrix


def walking(world, count, speed, *, x=0.0, height=0.7, sway=3.0, period=0.1):
    """Yield `count` poses of a robot that walks along x at `speed` [m/s].

    The body rolls and pitches by up to `sway` degrees about the slope of the ground and bobs by
    2 cm, at rates that share no period with the scans.
    """
    sway = math.radians(sway)
    for time in period * np.arange(count):
        place = x + speed * time
        bob = height + 0.02 * math.sin(2.0 * math.pi * 1.83 * time)
        roll = sway * math.sin(2.0 * math.pi * 0.91 * time)
        pitch = sway * math.sin(2.0 * math.pi * 1.37 * time + 1.0) - math.atan(world.slope)
        yield pose_of((place, 0.0, height_at(world, place, 0.0) + bob), roll, pitch)
