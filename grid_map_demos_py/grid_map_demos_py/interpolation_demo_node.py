# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_interpolation_demo`: measures the errors of four interpolation methods.

A world is a surface given by a formula. The demo samples a world on a coarse grid and interpolates
the samples on a fine grid. It publishes the true surface, the samples and the result, and prints an
error table for all methods and worlds.
"""

import time
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap, Interpolation
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.limits import check_cells
from grid_map_core_py.map import GridGeometry
from grid_map_ros_py import to_serialized_message

from .demo import Demo

Numbers = npt.NDArray[np.float64]

LAYER = "demo"

BORDER = 2
"""Width of the border omitted from the error table [cells]; some methods lack neighbors there."""

HILLS = [  # x, y, variance along x, variance along y, height
    (1.0, -1.0, 1.0, 0.3, -2.0),
    (1.0, 1.7, 0.25, 0.25, -1.0),
    (-1.0, 1.6, 0.1, 0.1, 2.0),
    (-1.8, -1.8, 0.1, 0.1, 1.0),
    (-1.0, 1.8, 0.1, 0.1, 3.0),
    (0.0, 0.0, 0.1, 0.05, 4.0),
    (-1.2, 0.0, 0.05, 0.05, 1.0),
]


def sine(x: Numbers, y: Numbers) -> Numbers:
    """Return a sum of four waves with different wavelengths."""
    return np.cos(x) + np.sin(2 * y) + np.cos(3 * x) + np.sin(4 * y)


def polynomial(x: Numbers, y: Numbers) -> Numbers:
    """Return a fourth-order polynomial."""
    return -((x - y) ** 2) + (x * y) ** 2


def gaussians(x: Numbers, y: Numbers) -> Numbers:
    """Return hills and hollows of several widths."""
    heights = [
        height * np.exp(-((x - x0) ** 2) / (2 * variance_x) - (y - y0) ** 2 / (2 * variance_y))
        for x0, y0, variance_x, variance_y, height in HILLS
    ]
    return np.asarray(np.sum(heights, axis=0))


def steps(x: Numbers, y: Numbers) -> Numbers:
    """Return two steep steps that cross."""
    return np.tanh(5 * x) + np.tanh(5 * y)


World = Callable[[Numbers, Numbers], Numbers]
WORLDS: dict[str, World] = {"Sine": sine, "Poly": polynomial, "Gauss": gaussians, "Tanh": steps}
METHODS = {
    "Nearest": Interpolation.NEAREST,
    "Linear": Interpolation.LINEAR,
    "Cubic_convolution": Interpolation.CUBIC_CONVOLUTION,
    "Cubic": Interpolation.CUBIC,
}


def sampled(world: World, geometry: GridGeometry) -> GridMap:
    """Return a map with the heights of a world at the cell centers of a grid."""
    x, y = geometry.axes_in_map_order()
    return GridMap.from_geometry(geometry, {LAYER: world(x[:, None], y)}, frame_id="map")


def interpolated(data: GridMap, geometry: GridGeometry, method: Interpolation) -> GridMap:
    """Interpolate the data at the cell centers of a grid."""
    result = GridMap.from_geometry(geometry, frame_id=data.frame_id)
    heights = np.asarray(data.at_position(LAYER, result.get_positions(), method))
    result[LAYER] = heights.reshape(result.size, order="F")
    return result


def measure(
    world: World, data: GridMap, geometry: GridGeometry, method: Interpolation
) -> tuple[float, float, float]:
    """Return the mean and largest error [m] of an interpolation, and the time per query [us]."""
    start = time.perf_counter()
    result = interpolated(data, geometry, method)
    duration = time.perf_counter() - start
    inner = slice(BORDER, -BORDER)
    errors = np.abs(result[LAYER] - sampled(world, geometry)[LAYER])[inner, inner]
    return float(errors.mean()), float(errors.max()), 1e6 * duration / result[LAYER].size


def table(data: GridGeometry, fine: GridGeometry) -> Iterator[str]:
    """Yield the lines of the error table for all worlds and methods."""
    yield (
        f"{fine.length[0]:g} m x {fine.length[1]:g} m, "
        f"interpolated from {data.resolution:g} m to {fine.resolution:g} m"
    )
    yield f"{'world':6} {'method':18} {'mean error':>11} {'max error':>11} {'us per query':>13}"
    for name, world in WORLDS.items():
        samples = sampled(world, data)
        for method_name, method in METHODS.items():
            mean, largest, microseconds = measure(world, samples, fine, method)
            yield f"{name:6} {method_name:18} {mean:11.6f} {largest:11.6f} {microseconds:13.4f}"


class InterpolationDemoNode(Demo):
    """Node that publishes a true surface, its samples and the interpolated samples."""

    def __init__(self) -> None:
        super().__init__("grid_map_interpolation_demo")
        about = "formula of the surface: Sine, Poly, Gauss, Tanh"
        world = WORLDS[self.read_choice("world", WORLDS, "Sine", about)]
        about = "interpolation of the published map: Nearest, Linear, Cubic_convolution, Cubic"
        method = METHODS[self.read_choice("interpolation_type", METHODS, "Nearest", about)]
        x = self.read_positive("world_size.length", 4.0, "extent along x [m]")
        y = self.read_positive("world_size.width", 4.0, "extent along y [m]")
        length = np.array([x, y])
        truth = self._read_geometry("groundtruth_resolution", length, 0.02, "the true surface")
        data = self._read_geometry("interpolation.data_resolution", length, 0.1, "the samples")
        # The interpolated map must stay within the samples, which cover whole cells.
        name = "interpolation.interpolated_resolution"
        fine = self._read_geometry(name, data.length, 0.02, "the interpolated map")
        samples = sampled(world, data)
        result = interpolated(samples, fine, method)
        result["error"] = np.abs(result[LAYER] - sampled(world, fine)[LAYER])
        self._publish("ground_truth", sampled(world, truth))
        self._publish("data_sparse", samples)
        self._publish("interpolated", result)
        print("\n".join(table(data, fine)), flush=True)

    def _read_geometry(self, name: str, length: Numbers, default: float, what: str) -> GridGeometry:
        resolution = self.read_positive(name, default, f"cell size of {what} [m]")
        geometry = GridGeometry(length, resolution)
        rows, columns = geometry.size
        few = 2 * BORDER + 1
        if min(rows, columns) < few:
            raise ConfigError(
                f"parameter {name!r}: expected at least {few} x {few} cells, got {rows} x {columns}"
            )
        check_cells(f"parameter {name!r}", geometry.size)
        return geometry

    def _publish(self, topic: str, grid_map: GridMap) -> None:
        grid_map.timestamp = self.get_clock().now().nanoseconds
        self.map_publisher(topic).publish(to_serialized_message(grid_map))


if __name__ == "__main__":
    raise SystemExit(InterpolationDemoNode.main())
