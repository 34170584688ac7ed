# SPDX-License-Identifier: BSD-3-Clause
"""Node `normal_filter_comparison_demo`: compares two algorithms that compute normals.

A formula defines the surface, so its true normals are known. The demo adds noise and outliers to
the heights and smooths the result. A filter chain then computes the normals with the algorithms
`area` and `raster`. The node prints a table of their errors, and publishes the maps.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
from ament_index_python.packages import get_package_share_directory

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import max_of_finites, mean_of_finites, sum_of_finites
from grid_map_filters_py import FilterChain
from grid_map_ros_py.nodes import read_parameter_tree

from .demo import Demo
from .parts import weighted_means

Numbers = npt.NDArray[np.float64]
Surface = tuple[Numbers, Numbers, Numbers]
"""Height [m] and slopes along x and y, as arrays with broadcastable shapes."""

ALGORITHMS = {"area": "directionalErrorArea", "raster": "directionalErrorRaster"}
"""Error layer of each algorithm."""

MOST_NOISE = 1e3


def wave(x: Numbers, y: Numbers, seconds: float) -> Surface:
    """Return a wave along y whose amplitude grows with x."""
    phase = 0.5 * seconds + 5.0 * y
    return -0.04 + 0.2 * np.sin(phase) * x, 0.2 * np.sin(phase), np.cos(phase) * x


def plane(x: Numbers, y: Numbers, _seconds: float) -> Surface:
    """Return a plane that rises along both x and y."""
    return 0.3 * x + 0.2 * y, np.full_like(x, 0.3), np.full_like(y, 0.2)


def hill(x: Numbers, y: Numbers, _seconds: float) -> Surface:
    """Return the heights and slopes of a round hill, 0.5 m high."""
    height = 0.5 * np.exp(-2.0 * (x**2 + y**2))
    return height, -4.0 * x * height, -4.0 * y * height


def cone(x: Numbers, y: Numbers, _seconds: float) -> Surface:
    """Return a cone; the slopes at its tip are 0."""
    distance = np.hypot(x, y)
    scale = np.divide(-0.4, distance, out=np.zeros_like(distance), where=distance > 1e-9)
    return 0.5 - 0.4 * distance, scale * x, scale * y


Shape = Callable[[Numbers, Numbers, float], Surface]
SHAPES: dict[str, Shape] = {"wave": wave, "plane": plane, "hill": hill, "cone": cone}


def surface_map(shape: str, seconds: float) -> GridMap:
    """Return a map of a surface at a time [s], with its true normals."""
    grid_map = GridMap((2.5, 4.0), 0.02, frame_id="map")
    x, y = grid_map.axes()
    height, *slopes = SHAPES[shape](x[:, None], y[None, :], seconds)
    normal = [-np.broadcast_to(slope, grid_map.size) for slope in slopes]
    normal.append(np.ones(grid_map.size))
    grid_map["elevation"] = height
    for axis, component in zip("xyz", normal / np.linalg.norm(normal, axis=0), strict=True):
        grid_map[f"normal_analytic_{axis}"] = component
    return grid_map


def disturb(grid_map: GridMap, noise: float, outliers: float, random: np.random.Generator) -> None:
    """Add uniform noise [m] and a share of infinite outliers, and smooth the heights."""
    grid_map["noise"] = random.uniform(-noise, noise, grid_map.size)
    noisy = grid_map["elevation"].astype(np.float64) + grid_map["noise"]
    count = int(outliers * noisy.size)
    noisy.flat[random.choice(noisy.size, count, replace=False)] = np.inf
    grid_map["elevation_noisy"] = noisy
    grid_map["elevation_filtered"] = (
        weighted_means(noisy, 0.1, grid_map.resolution) if noise or outliers else noisy
    )


def add_errors(grid_map: GridMap) -> None:
    """Add the error layers: 1 minus the cosine of the angle to the true normal."""
    for algorithm, layer in ALGORITHMS.items():
        pairs = [
            (grid_map[f"normal_analytic_{axis}"], grid_map[f"normal_{algorithm}_{axis}"])
            for axis in "xyz"
        ]
        # The raster algorithm computes no normals in border cells.
        cosines = np.full(grid_map.size, np.nan)
        inner = np.s_[1:-1, 1:-1]
        cosines[inner] = np.abs(sum(truth * found for truth, found in pairs))[inner]
        grid_map[layer] = 1.0 - cosines


def default_chain() -> FilterChain:
    """Return the filter chain with both algorithms."""
    folder = Path(get_package_share_directory("grid_map_demos_py"), "config")
    return FilterChain.from_yaml(folder / "normal_filter_comparison_demo.yaml")


def table(chain: FilterChain, noise: float, outliers: float) -> Iterator[str]:
    """Yield the lines of a table with the angular errors of the normals on every shape."""
    yield f"angle to the true normals, noise {noise:g} m, outliers {outliers:.1%}"
    yield f"{'shape':6} {'algorithm':10} {'mean [deg]':>11} {'max [deg]':>11}"
    for shape in SHAPES:
        grid_map = surface_map(shape, 0.0)
        disturb(grid_map, noise, outliers, np.random.default_rng(1))
        grid_map = chain(grid_map)
        add_errors(grid_map)
        for algorithm, layer in ALGORITHMS.items():
            angles = np.degrees(np.arccos(np.minimum(1.0 - grid_map[layer], 1.0)))
            mean, largest = mean_of_finites(angles), max_of_finites(angles)
            yield f"{shape:6} {algorithm:10} {mean:11.3f} {largest:11.3f}"


class NormalFilterComparisonDemoNode(Demo):
    """Node that publishes a surface, its true normals and its normals from two algorithms."""

    def __init__(self) -> None:
        super().__init__("normal_filter_comparison_demo")
        about = "shape of the surface: wave, plane, hill, cone"
        self._shape = self.read_choice("shape", SHAPES, "wave", about)
        about = "amplitude of the uniform noise [m]"
        self._noise = self.read_number("noise_on_map", 0.015, 0.0, MOST_NOISE, about)
        about = "share of cells that become outliers (infinite heights), 0 to 1"
        self._outliers = self.read_number("outliers_percentage", 0.0, 0.0, 1.0, about)
        about = "name of the parameter that holds the chain"
        name = self.read("filter_chain_parameter_name", "filters", about)
        about = "filter chain; by default, it runs both algorithms"
        given = read_parameter_tree(self, name, description=about)
        self._chain = FilterChain.from_config(given) if given else default_chain()
        self._random = np.random.default_rng()
        self._errors = dict.fromkeys(ALGORITHMS.values(), 0.0)
        print("\n".join(table(self._chain, self._noise, self._outliers)), flush=True)
        self.publish_maps(10.0)

    def map_at(self, seconds: float) -> GridMap:
        grid_map = surface_map(self._shape, seconds)
        disturb(grid_map, self._noise, self._outliers, self._random)
        grid_map = self._chain(grid_map)
        add_errors(grid_map)
        for layer, before in self._errors.items():
            error = np.nan_to_num(sum_of_finites(grid_map[layer]))
            self._errors[layer] = float(before + (error - before) / 20)
        text = ", ".join(f"{layer} = {error:f}" for layer, error in self._errors.items())
        self.get_logger().info(text, throttle_duration_sec=2.0)
        return grid_map


if __name__ == "__main__":
    raise SystemExit(NormalFilterComparisonDemoNode.main())
