# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_tutorial_demo`: adds noise to a map, filters it and measures the error.

The surface is a moving wave with noise and outliers. The demo smooths a part of the map, and logs
the error of the smoothed heights.
"""

import numpy as np

from grid_map_core_py import GridMap, cells_to_mask, submap_cells
from grid_map_core_py._arrays import Cells, Layer
from grid_map_core_py.plugins import check

from .demo import Demo
from .parts import weighted_means

MOST_NOISE = 1e3
MOST_OUTLIERS = 100_000
MOST_RADIUS = 1.0
"""Upper limits of the parameters; larger values would hide the wave or take too long."""

LAYERS = ["elevation", "normal_x", "normal_y", "normal_z"]


def make_map() -> GridMap:
    """Return an empty map of 40 x 67 cells."""
    return GridMap((1.2, 2.01), 0.03, position=(0.0, -0.1), layers=LAYERS, frame_id="map")


def add_wave(grid_map: GridMap, seconds: float) -> None:
    """Set the heights and normals of a sine wave along y at a time [s]."""
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
    """Set `elevation_noisy` to infinity in up to `count` random cells."""
    positions = random.uniform(-1.0, 1.0, (count, 2))
    cells, _ = grid_map.get_indices(positions[grid_map.is_inside(positions)])
    grid_map["elevation_noisy"][cells] = np.inf


def cells_to_filter(grid_map: GridMap) -> Cells:
    """Return the cells of the 1.2 m x 0.8 m rectangle whose upper left corner is (0.6, 0.4)."""
    # The corner is outside the map and is clamped to the border.
    corner = grid_map.get_closest_position_in_map((1.0, 0.4))
    rows, columns = int(1.2 / grid_map.resolution), int(0.8 / grid_map.resolution)
    return submap_cells(grid_map, grid_map.get_index(corner), (rows, columns))


def add_filtered(grid_map: GridMap, cells: Cells, radius: float) -> None:
    """Add the layers `elevation_filtered` (smoothed at `cells`) and `error` (absolute error)."""
    noisy = grid_map["elevation_noisy"]
    grid_map["elevation_filtered"] = noisy
    # OpenCV processes a layer as an image, so no loop over the cells is needed.
    means = weighted_means(noisy, radius, grid_map.resolution)
    grid_map["elevation_filtered"][cells] = means[cells]
    # Layers are NumPy arrays, so all NumPy functions accept them.
    grid_map["error"] = np.abs(grid_map["elevation_filtered"] - grid_map["elevation"])


def root_mean_square(values: Layer) -> float:
    """Return the root mean square of the finite values; NaN if there are none."""
    finite = values[np.isfinite(values)].astype(np.float64)
    return float(np.sqrt(np.mean(finite**2))) if finite.size else float("nan")


class TutorialDemoNode(Demo):
    """Node that publishes the wave with its noisy and filtered layers."""

    def __init__(self) -> None:
        super().__init__("grid_map_tutorial_demo")
        about = "amplitude of the uniform noise [m]"
        self._noise = self.read_number("noise", 0.015, 0.0, MOST_NOISE, about)
        about = "number of outliers (infinite heights); about half lie outside the map"
        self._outliers = self.read_number("outliers", 500, 0, MOST_OUTLIERS, about)
        about = "radius of the disc for the weighted mean [m], at most 1.0"
        self._radius = self.read_positive("radius", 0.1, about)
        check(self._radius <= MOST_RADIUS, "radius", f"at most {MOST_RADIUS}", self._radius)
        self._random = np.random.default_rng()
        self._map = make_map()
        self._filtered_cells = cells_to_filter(self._map)
        self.publish_maps(30.0)

    def map_at(self, seconds: float) -> GridMap:
        add_wave(self._map, seconds)
        add_noise(self._map, self._noise, self._random)
        add_outliers(self._map, self._outliers, self._random)
        add_filtered(self._map, self._filtered_cells, self._radius)
        error = self._map["error"]
        is_filtered = cells_to_mask(self._map, self._filtered_cells)
        inside = 1e3 * root_mean_square(error[is_filtered])
        outside = 1e3 * root_mean_square(error[~is_filtered])
        self.get_logger().info(
            f"root mean square error: {inside:.1f} mm in filtered cells, "
            f"{outside:.1f} mm in the others without their outliers",
            throttle_duration_sec=1.0,
        )
        return self._map


if __name__ == "__main__":
    raise SystemExit(TutorialDemoNode.main())
