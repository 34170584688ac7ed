# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_tutorial_demo`: a tour of the library in one loop.

The demo adds noise and outliers to a wave, filters a part of the map by weighted means, and
computes the error of the result. It publishes all layers on `grid_map`, 30 times a second, and logs
the error once a second.
"""

import numpy as np
from rclpy.node import Node

from grid_map_core_py import GridMap, cells_to_mask, submap_cells, window_array
from grid_map_core_py.arrays import Cells, Layer
from grid_map_core_py.plugins import check
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_serialized_message
from grid_map_ros_py.nodes import map_qos, read_parameter, read_positive, run

MOST_NOISE = 1e3
MOST_OUTLIERS = 100_000
MOST_RADIUS = 1.0
"""Limits of the parameters; larger values hide the wave or take too long."""

LAYERS = ["elevation", "normal_x", "normal_y", "normal_z"]


def make_map() -> GridMap:
    """Return an empty map of 40 x 67 cells."""
    return GridMap((1.2, 2.0), 0.03, position=(0.0, -0.1), layers=LAYERS, frame_id="map")


def add_wave(grid_map: GridMap, seconds: float) -> None:
    """Set elevation and normal vectors of the wave at a time: a sine along y that grows with x."""
    x, y = grid_map.axes()
    phase = 3.0 * seconds + 5.0 * y
    # A column of x and a row of y broadcast to all cells.
    grid_map["elevation"] = -0.04 + 0.2 * np.sin(phase) * x[:, None]
    along_x = 0.2 * np.sin(phase) + 0.0 * x[:, None]
    along_y = np.cos(phase) * x[:, None]
    normals = np.stack([-along_x, -along_y, np.ones(grid_map.size)])
    normals /= np.linalg.norm(normals, axis=0)
    for name, values in zip("xyz", normals, strict=True):
        grid_map[f"normal_{name}"] = values


def add_noise(grid_map: GridMap, largest: float, random: np.random.Generator) -> None:
    """Set `noise`, uniform between -`largest` and `largest` [m], and `elevation_noisy`."""
    grid_map["noise"] = random.uniform(-largest, largest, grid_map.size)
    grid_map["elevation_noisy"] = grid_map["elevation"] + grid_map["noise"]


def add_outliers(grid_map: GridMap, count: int, random: np.random.Generator) -> None:
    """Set `elevation_noisy` to infinity at random positions; some of them miss the map."""
    positions = random.uniform(-1.0, 1.0, (count, 2))
    cells, _ = grid_map.get_indices(positions[grid_map.is_inside(positions)])
    grid_map["elevation_noisy"][cells] = np.inf


def cells_to_filter(grid_map: GridMap) -> Cells:
    """Return the cells of a rectangle of 1.2 m x 0.8 m below its upper left corner (1, 0.4)."""
    # The corner is outside of the map and is moved to its border.
    corner = grid_map.get_closest_position_in_map((1.0, 0.4))
    rows, columns = int(1.2 / grid_map.resolution), int(0.8 / grid_map.resolution)
    return submap_cells(grid_map, grid_map.get_index(corner), (rows, columns))


def weighted_means(grid_map: GridMap, layer: str, cells: Cells, radius: float) -> Layer:
    """Return the weighted means (N,) of the finite values in the discs around N cells.

    The weight of a value is `(radius - distance)**2`. A mean is NaN if no value is finite.
    """
    reach = int(radius / grid_map.resolution)
    steps = grid_map.resolution * np.arange(-reach, reach + 1)
    weights = np.maximum(radius - np.hypot(steps[:, None], steps), 0.0) ** 2
    # The array of all windows is a view of the layer; indexing copies the windows of the cells.
    windows = window_array(grid_map, layer, "empty", len(steps))[cells]
    known = np.isfinite(windows)
    with np.errstate(invalid="ignore"):
        means = np.tensordot(np.where(known, windows, 0.0), weights) / np.tensordot(known, weights)
    return means.astype(np.float32)


def add_filtered(grid_map: GridMap, cells: Cells, radius: float) -> None:
    """Set `elevation_filtered`, with means in the given cells, and `error`, the absolute error."""
    grid_map["elevation_filtered"] = grid_map["elevation_noisy"]
    means = weighted_means(grid_map, "elevation_noisy", cells, radius)
    grid_map["elevation_filtered"][cells] = means
    # Layers are arrays, so that all of NumPy works on them.
    grid_map["error"] = np.abs(grid_map["elevation_filtered"] - grid_map["elevation"])


def root_mean_square(values: Layer) -> float:
    """Return the root mean square of the finite values; NaN if there are none."""
    finite = values[np.isfinite(values)].astype(np.float64)
    return float(np.sqrt(np.mean(finite**2))) if finite.size else float("nan")


class TutorialDemoNode(Node):
    """Publishes the wave with its noisy and filtered layers."""

    def __init__(self) -> None:
        super().__init__("grid_map_tutorial_demo")
        rate = read_positive(self, "publish_rate", 30.0, description="maps per second [Hz]")
        about = "largest noise, up or down [m]"
        self._noise = read_parameter(self, "noise", float, 0.015, description=about)
        expected = f"0 or a positive number, at most {MOST_NOISE:g}"
        check(0.0 <= self._noise <= MOST_NOISE, "noise", expected, self._noise)
        about = "number of outliers (infinite heights); about half miss the map"
        self._outliers = read_parameter(self, "outliers", int, 500, description=about)
        expected = f"0 or more, at most {MOST_OUTLIERS}"
        check(0 <= self._outliers <= MOST_OUTLIERS, "outliers", expected, self._outliers)
        about = "radius of the disc for the weighted mean [m], at most 1.0"
        self._radius = read_positive(self, "radius", 0.1, description=about)
        check(self._radius <= MOST_RADIUS, "radius", f"at most {MOST_RADIUS}", self._radius)
        self._random = np.random.default_rng()
        self._map = make_map()
        self._filtered_cells = cells_to_filter(self._map)
        self._publisher = self.create_publisher(GridMapMessage, "grid_map", map_qos())
        self.get_logger().info(f"publishes {self._map} on {self._publisher.topic_name}")
        self.create_timer(1.0 / rate, self._publish)

    def _publish(self) -> None:
        now = self.get_clock().now().nanoseconds
        add_wave(self._map, 1e-9 * now)
        add_noise(self._map, self._noise, self._random)
        add_outliers(self._map, self._outliers, self._random)
        add_filtered(self._map, self._filtered_cells, self._radius)
        self._map.timestamp = now
        self._publisher.publish(to_serialized_message(self._map))
        self._report(self._map["error"])

    def _report(self, error: Layer) -> None:
        is_filtered = cells_to_mask(self._map, self._filtered_cells)
        inside = 1e3 * root_mean_square(error[is_filtered])
        outside = 1e3 * root_mean_square(error[~is_filtered])
        self.get_logger().info(
            f"root mean square error: {inside:.1f} mm in filtered cells, "
            f"{outside:.1f} mm in the others without their outliers",
            throttle_duration_sec=1.0,
        )


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(TutorialDemoNode)


if __name__ == "__main__":
    raise SystemExit(main())
