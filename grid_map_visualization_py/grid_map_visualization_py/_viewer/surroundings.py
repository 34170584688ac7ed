# SPDX-License-Identifier: BSD-3-Clause
"""Axes with ticks around a map, a grid below it, and frames of coordinates."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from grid_map_core_py._arrays import Positions

AXES_COLOR = (128, 128, 128)
"""Gray, which is visible on white and on black."""

TICKS, HEIGHT_TICKS = 5, 3
"""Largest numbers of steps within the longer side of a map, and within its heights."""

FRAME_SIZE = 0.08
"""Length of the axes of a frame of coordinates, as a part of the distance to the camera."""


@dataclass(frozen=True)
class Axes:
    """Box around a map whose sides are whole numbers of steps.

    Attributes:
        steps: distances between the ticks along x, y and z [m].
        low, high: numbers of the first and of the last tick along x, y and z. The tick 0 is at the
            origin of the frame.
    """

    steps: tuple[float, ...]
    low: tuple[int, ...]
    high: tuple[int, ...]

    @property
    def corner(self) -> Positions:
        """Lowest corner (3,) of the box [m], map frame."""
        return np.multiply(self.low, self.steps)

    def lines(self) -> npt.NDArray[np.float32]:
        """Return the grid and the axis of the heights as lines (N, 2, 3) from the corner [m]."""
        (x, y, z) = (self._ticks(axis) * self.steps[axis] for axis in range(3))
        along_y = [[(tick, 0, 0), (tick, y[-1], 0)] for tick in x]
        along_x = [[(0, tick, 0), (x[-1], tick, 0)] for tick in y]
        return np.array([*along_y, *along_x, [(0, y[-1], 0), (0, y[-1], z[-1])]], np.float32)

    def labels(self) -> list[tuple[str, tuple[float, ...], str]]:
        """Return the texts at the axes, their places from the corner [m], and their anchors."""
        # Beside the sides that are near the first view, and the map as seen from above.
        back = float(self._ticks(1)[-1] * self.steps[1])
        starts = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, back, 0.0)])
        anchors = "top-left", "top-right", "center-right"
        labels = []
        for axis, (name, start, anchor) in enumerate(zip("xyz", starts, anchors, strict=True)):
            along = np.eye(3)[axis] * self.steps[axis]
            ticks = self._ticks(axis)
            for tick in ticks:
                text = f"{(self.low[axis] + int(tick)) * self.steps[axis]:.10g}"
                labels.append((text, tuple((start + tick * along).tolist()), anchor))
            # The far end of y is at the axis of the heights.
            end = start + (-0.5 if name == "y" else ticks[-1] + 0.5) * along
            labels.append((f"{name} [m]", tuple(end.tolist()), anchor))
        return labels

    def _ticks(self, axis: int) -> npt.NDArray[np.int64]:
        return np.arange(self.high[axis] - self.low[axis] + 1)


def axes_around(low: Positions, high: Positions, exaggeration: float) -> Axes:
    """Return axes around a box.

    Args:
        low, high: (3,) corners of the box [m].
        exaggeration: factor on the drawn heights.
    """
    length, width, height = (high - low).tolist()
    wide = round_step(max(length, width) / TICKS)
    # Labels of heights need some room.
    tall = round_step(max(height / HEIGHT_TICKS, 0.4 * wide / exaggeration))
    steps = wide, wide, tall
    first, last = np.floor(low / steps), np.ceil(high / steps)
    # Level ground needs an axis of its heights, too.
    last = np.maximum(last, first + 1)
    return Axes(steps, tuple(map(int, first)), tuple(map(int, last)))


def round_step(least: float) -> float:
    """Return the smallest of 1, 2 and 5 times a power of ten that is at least a number."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(step for k in (1, 2, 5, 10) if (step := k * power) >= 0.999999 * least)


class Surroundings:
    """Draws axes and frames.

    Args:
        scene: the scene of viser.
    """

    def __init__(self, scene: Any) -> None:
        self._scene = scene
        self._drawn: tuple[Axes, float, float] | None = None
        self._axes: Any = None
        self._frames: dict[str, tuple[Any, Any]] = {}

    def draw_axes(self, axes: Axes | None, exaggeration: float, base: float) -> None:
        """Draw these axes instead of those before; None for no axes.

        Args:
            axes: the axes.
            exaggeration: factor on the drawn heights.
            base: height that is drawn where it is [m].
        """
        wanted = None if axes is None else (axes, exaggeration, base)
        if wanted == self._drawn:
            return
        self._drawn = wanted
        if self._axes is not None:
            self._axes.remove()
            self._axes = None
        if axes is None:
            return
        add, lift = self._scene, np.array([1.0, 1.0, exaggeration])
        origin = np.array([0.0, 0.0, base])
        place = origin + lift * (axes.corner - origin)
        self._axes = add.add_frame("/axes", show_axes=False, position=place)
        style: Any = {"thickness": 1.5, "thickness_units": "screen"}
        add.add_line_segments("/axes/grid", axes.lines() * lift, AXES_COLOR, **style)
        for k, (text, place, anchor) in enumerate(axes.labels()):
            add.add_label(f"/axes/{k}", text, position=lift * place, anchor=anchor, depth_test=True)

    def draw_frame(
        self, name: str, label: str, pose: npt.NDArray[np.floating] | None, reach: float
    ) -> None:
        """Draw a frame of coordinates.

        Args:
            name: name of the node in the scene.
            label: name of the frame.
            pose: (4, 4) from the frame to the scene; None hides it.
            reach: distance between the camera and the map [m].
        """
        size = FRAME_SIZE * reach
        known, node = self._frames.get(name, (None, None))
        if known != (label, size):
            # A node of the same name replaces the one before.
            node = self._scene.add_frame(f"/{name}", axes_length=size, axes_radius=0.06 * size)
            self._scene.add_label(f"/{name}/label", label, anchor="bottom-left")
            self._frames[name] = ((label, size), node)
        node.visible = pose is not None
        if pose is not None:
            node.position = pose[:3, 3]
            node.wxyz = np.roll(Rotation.from_matrix(pose[:3, :3]).as_quat(), 1)
