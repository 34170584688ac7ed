# SPDX-License-Identifier: BSD-3-Clause
"""Draw the pictures of the pages on visualizations: the message that the YAML on each page makes.

    python3 docs/images/make_visualization_pictures.py [FOLDER]

writes one PNG per type into the folder, `docs/images/visualizations` by default. The pictures
are drawn from the messages themselves, so that they show the data that RViz receives.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from nav_msgs.msg import GridCells, OccupancyGrid
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Image, PointCloud2
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_filters_py import FilterChain
from grid_map_ros_py import read_points
from grid_map_visualization_py._registry import BUILT_IN, create

FOLDER = Path(__file__).parent / "visualizations"
PAGES = Path(__file__).parents[1] / "visualizations"
SIZE, DPI = (4.0, 2.6), 100


def scene() -> GridMap:
    """Return a hill beside a hollow, with a hole that sensors left, and the normals of it."""
    grid_map = GridMap((3.0, 2.0), 0.08, frame_id="map")
    x, y = (axis.reshape(grid_map.size, order="F") for axis in grid_map.get_positions().T)
    heights = 0.6 * np.exp(-3 * ((x + 0.6) ** 2 + (y - 0.1) ** 2))
    heights -= 0.25 * np.exp(-4 * ((x - 0.7) ** 2 + (y + 0.2) ** 2))
    grid_map["elevation"] = np.where(np.hypot(x - 0.9, y - 0.6) < 0.2, np.nan, heights)
    parameters = {"input_layer": "elevation", "output_layers_prefix": "normal_", "radius": 0.1}
    parameters["normal_vector_positive_axis"] = "z"
    step = {"name": "normals", "type": "NormalVectors", "params": parameters}
    return FilterChain.from_config([step])(grid_map)


def message_of(type_name: str, grid_map: GridMap) -> Any:
    """Return the message that the example on the page of a visualization makes."""
    page = (PAGES / f"{type_name}.md").read_text(encoding="utf-8")
    _, _, block = page.partition("```yaml\n")
    parameters = yaml.safe_load(block.partition("```")[0])["grid_map_visualization"]
    visualization = create("example", parameters["ros__parameters"]["example"])
    message = visualization(grid_map)
    if isinstance(message, bytes):
        return deserialize_message(message, visualization.message_type)
    return message


# --- messages, from above -------------------------------------------------------------------------


def draw_image(axes: Axes, message: Image) -> None:
    """Draw an image, +x up."""
    pixels = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, -1)
    axes.imshow(pixels, interpolation="nearest")


def draw_occupancy_grid(axes: Axes, message: OccupancyGrid) -> None:
    """Draw an occupancy grid in the colors of RViz."""
    info = message.info
    cells = np.array(message.data, np.float64).reshape(info.height, info.width)
    shown = np.where(cells < 0, np.nan, cells)
    axes.set_facecolor((0.44, 0.54, 0.53))  # RViz's color for unknown cells
    axes.imshow(shown, cmap="gray_r", origin="lower", vmin=0, vmax=100, interpolation="nearest")


def draw_grid_cells(axes: Axes, message: GridCells) -> None:
    """Draw the cells as squares with gaps."""
    side = 0.9 * message.cell_width
    squares = [
        Rectangle((cell.x - side / 2, cell.y - side / 2), side, side) for cell in message.cells
    ]
    axes.add_collection(PatchCollection(squares, facecolor="#20a040"))
    axes.set(xlim=(-1.5, 1.5), ylim=(-1.0, 1.0), aspect="equal")


# --- messages, in three dimensions ----------------------------------------------------------------


def draw_point_cloud(axes: Axes, message: PointCloud2) -> None:
    """Draw points, colored by the elevation."""
    fields = read_points(message)
    values = fields.get("elevation", fields["z"])
    axes.scatter(fields["x"], fields["y"], fields["z"], c=values, s=3.0, cmap="viridis")


def draw_marker(axes: Axes, message: Marker) -> None:
    """Draw lines or triangles."""
    points = np.array([(point.x, point.y, point.z) for point in message.points])
    colors = [(each.r, each.g, each.b) for each in message.colors or [message.color]]
    if message.type == Marker.TRIANGLE_LIST:
        faces = np.reshape(colors, (-1, 3, 3)).mean(axis=1)
        axes.add_collection3d(Poly3DCollection(points.reshape(-1, 3, 3), facecolors=faces))
    elif message.type == Marker.LINE_LIST:
        axes.add_collection3d(Line3DCollection(points.reshape(-1, 2, 3), colors=colors[:1], lw=0.8))
    else:
        axes.plot(*points.T, color=colors[0], lw=2.0)


DRAW: dict[type, Callable[[Axes, Any], None]] = {
    GridCells: draw_grid_cells,
    Image: draw_image,
    Marker: draw_marker,
    OccupancyGrid: draw_occupancy_grid,
    PointCloud2: draw_point_cloud,
}
IN_SPACE = (Marker, PointCloud2)


def draw(message: Any, path: Path) -> None:
    """Draw a message."""
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    if isinstance(message, IN_SPACE):
        axes = figure.add_subplot(projection="3d", elev=38, azim=-65)
        axes.set(xlim=(-1.5, 1.5), ylim=(-1.0, 1.0), zlim=(-0.3, 0.7))
        axes.set(xticks=(-1, 0, 1), yticks=(-1, 0, 1), zticks=(0.0, 0.5))
        axes.set_box_aspect((3.0, 2.0, 1.0), zoom=1.05)
        axes.tick_params(labelsize=7)
    else:
        axes = figure.add_subplot(xticks=(), yticks=())
    DRAW[type(message)](axes, message)
    # Without the version of Matplotlib, so that the files stay the same.
    figure.savefig(path, metadata={"Software": None})


def main(folder: Path) -> None:
    """Draw all pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    grid_map = scene()
    for type_name in BUILT_IN:
        draw(message_of(type_name, grid_map), folder / f"{type_name}.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
