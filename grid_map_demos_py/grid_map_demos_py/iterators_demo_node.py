# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_iterators_demo`: fills regions of a map cell by cell, in iteration order.

The layer `type` of the published map is 1 in the cells filled so far.
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import PolygonStamped

import grid_map_core_py as gm
from grid_map_core_py._arrays import Cells, Positions
from grid_map_ros_py import to_polygon, to_serialized_message
from grid_map_ros_py.nodes import map_qos

from .demo import Demo
from .parts import VERTICES

CENTER = (0.0, -0.15)
STAR = gm.Polygon(VERTICES)

REGIONS: dict[str, Callable[[gm.GridMap], Cells]] = {
    "the whole map": gm.map_cells,
    "a submap": lambda grid_map: gm.submap_cells(grid_map, (3, 5), (12, 7)),
    "a circle": lambda grid_map: gm.circle_cells(grid_map, CENTER, 0.4),
    "an ellipse": lambda grid_map: gm.ellipse_cells(grid_map, CENTER, (0.45, 0.9), math.pi / 4),
    "a spiral": lambda grid_map: gm.spiral_cells(grid_map, CENTER, 0.4),
    "a line": lambda grid_map: gm.line_cells_between(grid_map, (18, 2), (2, 13)),
    "a polygon": lambda grid_map: gm.polygon_cells(grid_map, STAR),
}
"""Functions that return the cells (rows, cols) of a region, in the order of the demo."""

WINDOW = 3  # side length of the sliding window [cells]
CELL_PAUSE, REGION_PAUSE = 0.02, 1.0  # pauses after every cell and after every region [s]


class Step(NamedTuple):
    """Step of the demo; the map is published after each step."""

    pause: float  # after the step [s]
    title: str = ""  # of the region that begins
    polygon: gm.Polygon | None = None  # to publish


def make_map() -> gm.GridMap:
    """Return an empty map of 20 x 20 cells."""
    return gm.GridMap((1.0, 1.0), 0.05, layers=["type"], frame_id="map")


def show_everything(grid_map: gm.GridMap) -> Iterator[Step]:
    """Yield the steps that fill the regions one by one and show the sliding window."""
    yield Step(2.0)
    for title, find_cells in REGIONS.items():
        grid_map.clear_all()
        yield Step(0.0, title, STAR if title == "a polygon" else None)
        # Outside of a demo, fill all cells at once: `grid_map["type"][cells] = 1.0`.
        for row, column in zip(*find_cells(grid_map), strict=True):
            grid_map["type"][row, column] = 1.0
            yield Step(CELL_PAUSE)
        yield Step(REGION_PAUSE)
    yield from show_sliding_window(grid_map)


def show_sliding_window(grid_map: gm.GridMap) -> Iterator[Step]:
    """Yield the steps that blur a filled polygon; each step sets one cell to its window's mean."""
    grid_map["type"] = 0.0
    grid_map["type"][gm.polygon_cells(grid_map, STAR)] = 1.0
    yield Step(CELL_PAUSE, "a sliding window", STAR)
    # Windows contain the original values, because the iterator copies the layer.
    for cell, window in gm.sliding_windows(grid_map, "type", "crop", WINDOW):
        grid_map["type"][cell] = gm.mean_of_finites(window)
        yield Step(CELL_PAUSE, polygon=square(grid_map, grid_map.get_position(cell)))
    yield Step(REGION_PAUSE)


def square(grid_map: gm.GridMap, center: Positions) -> gm.Polygon:
    """Return the outline of the sliding window around a position (2,)."""
    corners = np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)])
    return gm.Polygon(center + 0.5 * WINDOW * grid_map.resolution * corners)


class IteratorsDemoNode(Demo):
    """Node that publishes the map after every step."""

    def __init__(self) -> None:
        super().__init__("grid_map_iterators_demo")
        about = "speed factor; 1.0 means 50 cells per second"
        self._speed = self.read_positive("speed", 1.0, about)
        self._repeat = self.read("repeat", False, "start again after the last region")
        self._map = make_map()
        self._steps = show_everything(self._map)
        self._map_publisher = self.map_publisher()
        self._polygon_publisher = self.create_publisher(PolygonStamped, "polygon", map_qos())
        self._timer = self.create_timer(0.0, self._on_timer)

    def _on_timer(self) -> None:
        step = next(self._steps, None)
        if step is not None:
            self._publish(step)
            self._timer.timer_period_ns = round(1e9 * step.pause / self._speed)
            # Without a reset, the new period would take effect only after the current one.
            self._timer.reset()
        elif self._repeat:
            self._steps = show_everything(self._map)
        else:
            self._timer.cancel()

    def _publish(self, step: Step) -> None:
        if step.title:
            self.get_logger().info(f"shows {step.title}")
        now = self.get_clock().now().nanoseconds
        self._map.timestamp = now
        self._map_publisher.publish(to_serialized_message(self._map))
        if step.polygon is not None:
            frame_id = self._map.frame_id
            polygon = to_polygon(step.polygon, frame_id=frame_id, timestamp=now)
            self._polygon_publisher.publish(polygon)


if __name__ == "__main__":
    raise SystemExit(IteratorsDemoNode.main())
