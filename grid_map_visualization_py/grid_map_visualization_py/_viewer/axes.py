# SPDX-License-Identifier: BSD-3-Clause
"""Axes with ticks around a map, and a grid below the map."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Positions

TICKS, HEIGHT_TICKS = 8, 3
"""Maximum number of tick intervals along the longer side of a map, and along its height range."""


@dataclass(frozen=True)
class Axes:
    """Box around a map; the length of each side is a multiple of the tick distance.

    Attributes:
        steps: tick distances along x, y and z [m].
        low, high: indices of the first and last ticks. Tick 0 is at the origin of the frame.
    """

    steps: tuple[float, ...]
    low: tuple[int, ...]
    high: tuple[int, ...]

    @property
    def corner(self) -> Positions:
        """Lowest corner (3,) of the box [m], map frame."""
        return np.multiply(self.low, self.steps)

    def lines(self) -> npt.NDArray[np.float32]:
        """Return the grid and the z axis as lines (N, 2, 3), relative to `corner` [m]."""
        x, y, z = (
            step * np.arange(last - first + 1)
            for step, first, last in zip(self.steps, self.low, self.high, strict=True)
        )
        along_y = [[(tick, 0, 0), (tick, y[-1], 0)] for tick in x]
        along_x = [[(0, tick, 0), (x[-1], tick, 0)] for tick in y]
        return np.array([*along_y, *along_x, [(0, y[-1], 0), (0, y[-1], z[-1])]], np.float32)

    def labels(self) -> list[tuple[str, tuple[float, ...], str]]:
        """Return the text, position [m] and anchor of each axis label, relative to `corner` [m]."""
        # Labels are placed outside the map, on the sides that face the initial camera.
        back = (self.high[1] - self.low[1]) * self.steps[1]
        starts = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, back, 0.0)])
        anchors = "top-left", "top-right", "center-right"
        labels = []
        for axis, (name, start, anchor) in enumerate(zip("xyz", starts, anchors, strict=True)):
            step, first, last = self.steps[axis], self.low[axis], self.high[axis]
            along = np.eye(3)[axis] * step
            # At the far end of the y axis, there is a label of the z axis.
            numbers = range(first, last + (name != "y"))
            places = [(f"{number * step:.10g}", float(number - first)) for number in numbers]
            # Beyond the ends of the x and y axes, panels would cover the names.
            end = last - first if name == "z" else (last - first) // 2
            places.append((f"{name} [m]", end + 0.5))
            labels += [(text, tuple((start + at * along).tolist()), anchor) for text, at in places]
        return labels


def axes_around(low: Positions, high: Positions, exaggeration: float) -> Axes:
    """Return the axes around a box with the corners `low` and `high` (3,) [m]."""
    length, width, height = (high - low).tolist()
    wide = round_step(max(length, width) / TICKS)
    # Height labels must not overlap.
    tall = round_step(max(height / HEIGHT_TICKS, 0.6 * wide / exaggeration))
    steps = wide, wide, tall
    first, last = np.floor(low / steps), np.ceil(high / steps)
    # Level ground also needs a z axis.
    last = np.maximum(last, first + 1)
    return Axes(steps, tuple(map(int, first)), tuple(map(int, last)))


def round_step(least: float) -> float:
    """Return the smallest number >= `least` that is 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(step for k in (1, 2, 5, 10) if (step := k * power) >= 0.999999 * least)
