# SPDX-License-Identifier: BSD-3-Clause
"""Draw the pictures of the pages on demos, from the functions that the demos consist of.

    python3 docs/images/make_demo_pictures.py [FOLDER]

writes one PNG per demo in `PICTURES` into the folder, `docs/images/demos` by default.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
import yaml
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import change_resolution, from_image, to_image
from grid_map_core_py.elevation import ElevationMapper
from grid_map_core_py.map import GridGeometry
from grid_map_core_py.planes import PlaneParameters, extract_planes
from grid_map_core_py.simulation import scan
from grid_map_demos_py import (
    image_publisher_node as image_publisher,
    interpolation_demo_node as interpolation,
    iterators_demo_node as iterators,
    large_site,
    move_demo_node as move,
    normal_filter_comparison_demo_node as comparison,
    opencv_demo_node as opencv,
    report_node as report,
    robot_course as robot,
    sdf_demo_node as sdf,
    steps_course as steps,
    tutorial_demo_node as tutorial,
)
from grid_map_demos_py.parts import HEIGHT, star_map
from grid_map_demos_py.robot_course import RobotCourse, load_course
from grid_map_filters_py import FilterChain
from grid_map_ros_py import load_octomap
from grid_map_ros_py._planning import Planner, PlannerSettings
from grid_map_visualization_py.pictures import plot

FOLDER = Path(__file__).parent / "demos"
DATA = Path(__file__).parents[2] / "grid_map_demos_py" / "data"
CONFIG = DATA.parent / "config"
DPI = 80


def tutorial_demo() -> Figure:
    """Draw the wave, the wave with noise, and the filtered wave."""
    random = np.random.default_rng(1)
    grid_map = tutorial.make_map()
    tutorial.add_wave(grid_map, 0.35)
    tutorial.add_noise(grid_map, 0.015, random)
    tutorial.add_outliers(grid_map, 500, random)
    tutorial.add_filtered(grid_map, tutorial.cells_to_filter(grid_map), 0.1)
    figure, axes = new_figure(1, 3, (9.0, 4.0))
    for ax, layer in zip(axes, ["elevation_noisy", "elevation_filtered", "error"], strict=True):
        # Infinite heights are drawn as holes.
        grid_map[layer][~np.isfinite(grid_map[layer])] = np.nan
        limits = (0.0, 0.015) if layer == "error" else (-0.17, 0.09)
        colors = "magma" if layer == "error" else "viridis"
        draw(grid_map, layer, ax, layer, limits=limits, color_map=colors)
    return figure


def iterators_demo() -> Figure:
    """Draw each region in the end, and its cells by their order."""
    figure, axes = new_figure(2, 4, (9.0, 4.8))
    grid_map = iterators.make_map()
    for ax, (title, find_cells) in zip(axes, iterators.REGIONS.items(), strict=False):
        cells = find_cells(grid_map)
        grid_map.clear_all()
        grid_map["type"][cells] = np.linspace(0.0, 1.0, len(cells[0]))
        draw(grid_map, "type", ax, title, limits=(0.0, 1.0))
    for _ in iterators.show_sliding_window(grid_map):
        pass
    draw(grid_map, "type", axes[-1], "a sliding window", limits=(0.0, 1.0))
    return figure


def elevation_mapping_demo() -> Figure:
    """Draw true terrain, estimate, error and claimed deviation after a drive of 6 s."""
    course = RobotCourse(load_course(DATA / "jacksboro_fault_dem.npz"), 0.6)
    mapper = ElevationMapper(GridGeometry((10.0, 10.0), 0.1))
    random = np.random.default_rng(1)
    for step in range(31):
        seconds = 0.2 * step
        terrain, pose = course.terrain_at(seconds), course.pose_at(seconds)
        for mount, beams, noise in robot.SENSORS.values():
            points = scan(terrain, beams, pose @ mount, sensor=noise, random=random, max_range=20.0)
            mapper.update(
                points,
                pose @ mount,
                timestamp=int(1e9 * seconds),
                position=pose[:2, 3],
                sensor=noise,
            )
    compared, _ = report.compare(mapper.grid_map, terrain)
    figure, axes = new_figure(1, 4, (6.8, 2.1))
    panels: list[tuple[str, str, tuple[float, float], str]] = [
        ("truth", "true terrain", (0.0, 1.3), "gist_earth"),
        ("estimate", "estimate", (0.0, 1.3), "gist_earth"),
        ("error", "error to ±5 cm", (-0.05, 0.05), "RdBu"),
        ("deviation", "deviation to 1 cm", (0.0, 0.01), "viridis"),
    ]
    for ax, (layer, title, limits, colors) in zip(axes, panels, strict=True):
        draw(compared, layer, ax, title, limits=limits, color_map=colors)
    return figure


def path_planner_demo() -> Figure:
    """Draw plans and the walked path; the robot maps after each stride."""
    ground = robot.load_cliff(DATA / "jacksboro_fault_dem.npz")
    text = (CONFIG / "path_planner_demo_mapping.yaml").read_text(encoding="utf-8")
    pipeline = yaml.safe_load(text)["elevation_mapping"]["ros__parameters"]
    chain = FilterChain.from_config([*pipeline["postprocessor_pipeline"].values()])
    text = (CONFIG / "path_planner_demo_planner.yaml").read_text(encoding="utf-8")
    given = yaml.safe_load(text)["path_planner"]["ros__parameters"]
    names = {field.name for field in fields(PlannerSettings)}
    settings = PlannerSettings(**{k: value for k, value in given.items() if k in names})
    mapper = ElevationMapper(GridGeometry((20.0, 20.0), 0.1))
    walker, random = robot.Walker(), np.random.default_rng(1)
    plans, walk = list[robot.Matrix](), [walker.position]
    for step in range(100):
        pose = robot.standing_pose(ground, walker.position, walker.way)
        for mount, beams, noise in robot.SENSORS.values():
            options = {"sensor": noise, "max_range": robot.MAX_RANGE}
            points = scan(ground, beams, pose @ mount, random=random, **options)
            mapper.update(points, pose @ mount, timestamp=step * 4 * 10**8, position=pose[:2, 3])
        planner = Planner(chain(mapper.grid_map), settings)
        if step == 0 or planner.blocked(plans[-1])[1:].any():
            path = planner.graph.path(walker.position, robot.GOAL, tolerance=settings.tolerance)
            plans.append(path.positions)
            walker.follow(path.positions)
        walker.walk(robot.STRIDE)
        walk.append(walker.position)
        if math.dist(walker.position, robot.GOAL) < robot.ARRIVED:
            break
    truth = ground.get_submap((4.25, 2.0), (10.5, 12.0))
    return report.draw_walk(truth, planner.grid_map, plans, np.array(walk))


def planar_regions_demo() -> Figure:
    """Draw the planar regions of the course after the camera has passed."""
    course, random = steps.make_course(), np.random.default_rng(1)
    mapper = ElevationMapper(GridGeometry((12.0, 4.0), 0.04))
    for step, x in enumerate(np.linspace(0.0, steps.END, 50)):
        pose = steps.pose_at(x)
        options = {"sensor": steps.NOISE, "max_range": steps.MAX_RANGE}
        points = scan(course, steps.BEAMS, pose, random=random, **options)
        given = {"timestamp": step * 2 * 10**8, "position": pose[:2, 3], "sensor": steps.NOISE}
        mapper.update(points, pose, **given)
    text = (CONFIG / "planar_regions_demo_regions.yaml").read_text(encoding="utf-8")
    given = yaml.safe_load(text)["planar_regions"]["ros__parameters"]
    sections = {name: value for name, value in given.items() if isinstance(value, dict)}
    parameters = PlaneParameters.from_mapping(sections)
    regions = extract_planes(mapper.grid_map, given["height_layer"], parameters)
    result = mapper.grid_map.with_start_index((0, 0)).with_layers(regions.layers())
    return report.draw_regions(result)


def large_map_demo() -> Figure:
    """Draw the ground along the way, thinned, and a window."""
    thinned = GridGeometry(large_site.GEOMETRY.length, 6.4)
    grid_map = GridMap.from_geometry(thinned, layers={"elevation": large_site.ground(thinned)})
    x, y = grid_map.axes()
    is_far = np.abs(y - large_site.way_at(x)[:, None]) > large_site.CORRIDOR
    is_far |= np.abs(x[:, None]) > large_site.END
    grid_map["elevation"][is_far] = np.nan
    place = (640.0, float(large_site.way_at(640.0)))
    window = GridMap((20.0, 20.0), 0.1, place)
    window["elevation"] = large_site.ground(window.geometry)
    figure, axes = new_figure(1, 2, (6.2, 2.9))
    limits = (-8.0, 10.0)
    draw(grid_map, "elevation", axes[0], "ground on disk", limits=limits, color_map="gist_earth")
    axes[0].plot(*place, "s", color="tab:red", markersize=5, markerfacecolor="none")
    plot(window, "elevation", axes[1], color_map="gist_earth", label=" ")
    axes[1].set_title("a window of 20 m x 20 m, heights in m", fontsize=9)
    axes[1].set(xlabel="", ylabel="")
    axes[1].tick_params(labelsize=7)
    return figure


def move_demo() -> Figure:
    """Draw a map before and after both ways to change its position."""
    figure, axes = new_figure(1, 3, (9.0, 2.9))
    grid_map = move.make_map()
    x, y = grid_map.axes()
    # A regular pattern instead of noise, so that motion is visible.
    grid_map["layer"] = np.sin(12.0 * np.hypot(x[:, None] - 0.1, y))
    moved, carried = grid_map.copy(), grid_map.copy()
    moved.move((0.2, 0.1))
    carried.position = (0.2, 0.1)
    titles = ["before", "move((0.2, 0.1))", "position = (0.2, 0.1)"]
    for ax, one, title in zip(axes, [grid_map, moved, carried], titles, strict=True):
        draw(one, "layer", ax, title, limits=(-1.0, 1.0))
        ax.set(xlim=(-0.4, 0.6), ylim=(-0.4, 0.5))
        corner = one.position - 0.5 * one.length
        ax.add_patch(Rectangle(corner, *one.length, fill=False, edgecolor="tab:red"))
        ax.plot(0.0, 0.0, "+", color="tab:red", markersize=12)
    return figure


def image_to_gridmap_demo() -> Figure:
    """Draw the default image, and the map made from it."""
    pixels = image_publisher.read_image(DATA / "terrain.png")
    grid_map = from_image(pixels, "elevation", 0.03, -0.1, 0.4)
    figure, axes = new_figure(1, 2, (5.2, 2.7))
    axes[0].imshow(pixels[..., [2, 1, 0, 3]], interpolation="nearest")
    axes[0].set_title("the image", fontsize=9)
    axes[0].set_axis_off()
    draw(grid_map, "elevation", axes[1], "elevation", limits=(-0.1, 0.4), color_map="gray")
    return figure


def opencv_demo() -> Figure:
    """Draw the star before and after blurring."""
    figure, axes = new_figure(1, 4, (9.0, 3.9))
    for with_ground, kernels in ((True, (1, 41, 121)), (False, (41,))):
        grid_map = star_map("original", 0.01, has_ground=with_ground)
        channels = 1 if with_ground else 4
        image = to_image(grid_map, "original", np.uint16, channels, 0.0, HEIGHT)
        for ax, size in zip(axes if with_ground else axes[3:], kernels, strict=False):
            opencv.blur(grid_map, image, size)
            title = f"{size} x {size} pixels" + ("" if with_ground else ", transparent")
            draw(grid_map, "elevation", ax, title, limits=(0.0, HEIGHT))
    return figure


def resolution_change_demo() -> Figure:
    """Draw the star in its original cells, and in smaller and larger ones."""
    figure, axes = new_figure(1, 3, (7.0, 4.0))
    star = star_map("elevation", 0.03)
    for ax, side in zip(axes, (0.03, 0.01, 0.09), strict=True):
        scaled = change_resolution(star, side)
        draw(scaled, "elevation", ax, f"{100 * side:.0f} cm", limits=(0.0, HEIGHT))
    return figure


def octomap_to_gridmap_demo() -> Figure:
    """Draw the room from above, without and with its ceiling."""
    figure, axes = new_figure(1, 2, (7.0, 3.9))
    for ax, max_z, title in zip(axes, (2.0, np.nan), ("max_z: 2.0", "no max_z"), strict=True):
        grid_map = load_octomap(DATA / "room.bt", max_bound=(np.nan, np.nan, max_z))
        draw(grid_map, "elevation", ax, title, limits=(0.0, 2.5))
    return figure


def interpolation_demo() -> Figure:
    """Draw the steepest surface, and the errors of three methods."""
    length = np.array([4.0, 4.0])
    fine, world = GridGeometry(length, 0.04), interpolation.WORLDS["Gauss"]
    data = interpolation.sampled(world, GridGeometry(length, 0.2))
    truth = interpolation.sampled(world, fine)
    figure, axes = new_figure(1, 4, (6.8, 2.1))
    draw(truth, "demo", axes[0], "the truth", limits=(-2.0, 5.0))
    for ax, name in zip(axes[1:], ["Nearest", "Linear", "Cubic"], strict=True):
        found = interpolation.interpolated(data, fine, interpolation.METHODS[name])
        found["error"] = np.abs(found["demo"] - truth["demo"])
        draw(found, "error", ax, f"error of {name}", limits=(0.0, 0.5), color_map="magma")
    return figure


def normal_filter_comparison_demo() -> Figure:
    """Draw a surface with noise, and the errors of both algorithms for normals."""
    grid_map = comparison.surface_map("wave", 0.0)
    comparison.disturb(grid_map, 0.015, 0.0, np.random.default_rng(1))
    grid_map = comparison.default_chain()(grid_map)
    comparison.add_errors(grid_map)
    # A part of the picture is enough; noise would make the whole file large.
    grid_map = grid_map.get_submap((0.6, 0.0), (1.0, 1.2))
    figure, axes = new_figure(1, 3, (7.0, 2.5))
    draw(grid_map, "elevation_noisy", axes[0], "elevation_noisy", limits=(-0.3, 0.2))
    for ax, layer in zip(axes[1:], comparison.ALGORITHMS.values(), strict=True):
        draw(grid_map, layer, ax, layer, limits=(0.0, 0.005), color_map="magma")
    return figure


def sdf_demo() -> Figure:
    """Draw the map that the launch file makes, and the distances in a section through it."""
    pixels = image_publisher.read_image(DATA / "terrain.png")
    grid_map = from_image(pixels, "elevation", 0.03, -0.3, 0.4)
    field = sdf.distance_field(grid_map, "elevation")
    figure, axes = new_figure(1, 2, (9.0, 2.6))
    draw(grid_map, "elevation", axes[0], "elevation", limits=(-0.3, 0.4), color_map="gray")
    axes[0].axhline(0.0, color="tab:red", linewidth=1.0)
    section = field.distances[:, grid_map.size[1] // 2, :].T
    x, _ = field.geometry.axes_in_map_order()
    drawn = axes[1].contourf(x, field.levels, section, np.arange(-0.5, 0.55, 0.05), cmap="RdBu")
    axes[1].contour(x, field.levels, section, [0.0], colors="black")
    axes[1].set_title("distance to the surface [m], along the red line", fontsize=9)
    axes[1].set_aspect("equal")
    axes[1].tick_params(labelsize=7)
    figure.colorbar(drawn, ax=axes[1]).ax.tick_params(labelsize=7)
    return figure


PICTURES: dict[str, Callable[[], Figure]] = {
    "elevation_mapping_demo": elevation_mapping_demo,
    "image_to_gridmap_demo": image_to_gridmap_demo,
    "interpolation_demo": interpolation_demo,
    "iterators_demo": iterators_demo,
    "large_map_demo": large_map_demo,
    "move_demo": move_demo,
    "normal_filter_comparison_demo": normal_filter_comparison_demo,
    "octomap_to_gridmap_demo": octomap_to_gridmap_demo,
    "opencv_demo": opencv_demo,
    "path_planner_demo": path_planner_demo,
    "planar_regions_demo": planar_regions_demo,
    "resolution_change_demo": resolution_change_demo,
    "sdf_demo": sdf_demo,
    "tutorial_demo": tutorial_demo,
}


def new_figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """Return a figure of `size` [inches] and its axes."""
    figure = Figure(size, layout="constrained")
    return figure, list(figure.subplots(rows, columns, squeeze=False).flat)


def draw(
    grid_map: GridMap,
    layer: str,
    ax: Axes,
    title: str,
    *,
    limits: tuple[float, float],
    color_map: str = "viridis",
) -> None:
    """Draw a layer between two values."""
    lower, upper = limits
    plot(
        grid_map,
        layer,
        ax,
        lower=lower,
        upper=upper,
        color_map=color_map,
        color_bar=False,
        scale_bar=False,
    )
    ax.set_title(title, fontsize=9)
    ax.set(xlabel="", ylabel="")
    ax.tick_params(labelsize=7)


def main() -> None:
    """Draw all pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in PICTURES.items():
        # Without the version of Matplotlib, which would make every picture differ.
        make().savefig(folder / f"{name}.png", dpi=DPI, metadata={"Software": None})


if __name__ == "__main__":
    main()
