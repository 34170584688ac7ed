# SPDX-License-Identifier: BSD-3-Clause
"""Nodes that collect the messages of a demo, write pictures, print tables, and exit.

    python3 -m grid_map_demos_py.report_node \
        filters | elevation_mapping | large_map | path_planner | planar_regions

The exit code is 0 only if messages arrived on all topics in time.
"""

import math
import sys
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from statistics import median
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from matplotlib.figure import Figure
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker

from grid_map_core_py import GridGeometry, GridMap, Interpolation
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files._shared import storage_errors
from grid_map_core_py.plugins import check
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import ReceivedMap, from_pose
from grid_map_ros_py.errors import NodeFailedError
from grid_map_ros_py.nodes import MapSubscription, map_qos
from grid_map_ros_py.nodes._spin import steady_timer
from grid_map_visualization_py.pictures import plot, save_picture

from .demo import Demo
from .large_site import GEOMETRY, LAYER
from .parts import to_text
from .robot_course import ARRIVED, GOAL, START, Matrix
from .steps_course import END, PLANES

DIAGNOSTICS = "/diagnostics"

Tables = Mapping[str, Mapping[Any, object]]  # tables by title; each row is a name and a value

Pictures = Mapping[str, Figure | tuple[GridMap, str, Mapping[str, Any]]]
"""Pictures by name: a figure, or a map, a layer, and options of `save_picture`."""


class ReportNode(Demo):
    """Base class of nodes that end with a report or, after a timeout, with an error."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        about = "folder for the pictures"
        self._directory = self.read_path("output_directory", "demo_output", about)
        # Fail now, not after a minute of collecting messages.
        with storage_errors(self._directory, "made a folder"):
            self._directory.mkdir(parents=True, exist_ok=True)

    def silent_topics(self) -> list[str]:
        """Return the topics on which too few messages have arrived."""
        raise NotImplementedError

    def give_up_after(self, seconds: float) -> None:
        def give_up() -> None:
            silent = ", ".join(self.silent_topics())
            raise NodeFailedError(f"after {seconds:g} s too few messages on {silent}")

        steady_timer(self, seconds, give_up)

    def finish(self, tables: Tables, pictures: Pictures) -> None:
        """Write the pictures, print the tables and end the node."""
        files = {self._directory / f"{name}.png": entry for name, entry in pictures.items()}
        try:
            with storage_errors(self._directory, "filled with pictures"):
                for file, entry in files.items():
                    if isinstance(entry, Figure):
                        entry.savefig(file, dpi=150)
                    else:
                        grid_map, layer, options = entry
                        save_picture(grid_map, layer, file, **options)
        except GridMapError as error:
            raise NodeFailedError(str(error)) from error
        print(to_text({**tables, "Pictures": dict.fromkeys(files, "")}), flush=True)
        self.context.try_shutdown()


def size_of(size: tuple[int, int]) -> str:
    """Format a map size as text, including the number of cells."""
    return f"{size[0]} x {size[1]} = {size[0] * size[1]}"


# --- filters demo ---------------------------------------------------------------------------------

FILTERED = "/filtered_map"
FILTER_CHAIN = "grid_map_filters"  # name of the diagnostic status of the filter chain

COUNTED = {
    "/grid_map": GridMapMessage,
    "/elevation_points": PointCloud2,
    "/traversability_grid": OccupancyGrid,
    "/surface_normals": Marker,
    "/map_region": Marker,
}
"""Topics whose messages are counted but not read, with their message types."""


class DemoReportNode(ReportNode):
    """Node that collects messages of the filters demo until enough have arrived."""

    def __init__(self) -> None:
        super().__init__("grid_map_demo_report")
        self._needed = self.read("messages", 3, "number of messages to wait for on every topic")
        check(self._needed >= 1, "messages", "at least 1", self._needed)
        self._counts = dict.fromkeys([*COUNTED, FILTERED, DIAGNOSTICS], 0)
        self._times: dict[str, list[float]] = {}
        self._latencies: list[float] = []
        self._filtered: GridMap | None = None
        for topic, message_type in COUNTED.items():
            # Raw messages are counted without converting them to Python.
            count = partial(self._count, topic)
            self.create_subscription(message_type, topic, count, map_qos(), raw=True)
        self._filtered_maps = MapSubscription(self, FILTERED, self._on_filtered)
        self.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, 10)
        self.give_up_after(self.read_positive("timeout", 60.0, "maximum time to wait [s]"))

    def silent_topics(self) -> list[str]:
        return [topic for topic, count in self._counts.items() if count < self._needed]

    def _on_filtered(self, received: ReceivedMap) -> None:
        self._filtered = received.decode()
        now = self.get_clock().now().nanoseconds
        self._latencies.append(1e-6 * (now - self._filtered.timestamp))
        self._count(FILTERED)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        # All nodes publish on `/diagnostics`; use only the status of the filter chain.
        for status in message.status:
            if status.name == FILTER_CHAIN:
                times = [(v.key[3:], v.value) for v in status.values if v.key.startswith("ms ")]
                with suppress(ValueError):  # Another program may publish text values.
                    for name, milliseconds in [(name, float(ms)) for name, ms in times]:
                        self._times.setdefault(name, []).append(milliseconds)
                    self._count(DIAGNOSTICS)

    def _count(self, topic: str, _message: bytes = b"") -> None:
        self._counts[topic] += 1
        if self._filtered is None or self.silent_topics():
            return
        times = {name: median(values) for name, values in self._times.items()}
        times["whole chain"] = sum(times.values())
        tables: Tables = {
            "Map": {
                "cells": size_of(self._filtered.size),
                "resolution": f"{self._filtered.resolution} m",
                "layers": len(self._filtered.layers),
            },
            "Layers": dict.fromkeys(self._filtered, ""),
            "Milliseconds per filter (median)": {n: f"{value:.2f}" for n, value in times.items()},
            "End-to-end latency (median)": {
                "published to filtered": f"{median(self._latencies):.0f} ms"
            },
            "Messages per topic": self._counts,
        }
        shaded = {"hillshade": "elevation_inpainted", "color_map": "gist_earth"}
        shaded |= {"title": "Published elevation; holes are white", "label": "elevation [m]"}
        relief = {"style": "relief", "color_layer": "traversability", "color_map": "BrBG"}
        bounds = {"lower": 0.2, "upper": 1.0}
        pictures: Pictures = {
            "elevation": (self._filtered, "elevation", {**shaded, "exaggeration": 1.5}),
            "traversability": (
                self._filtered,
                "elevation_inpainted",
                {**relief, **bounds, "exaggeration": 1.3},
            ),
        }
        self.finish(tables, pictures)


# --- elevation mapping demo -----------------------------------------------------------------------

TRUTH = "/true_terrain"
RAW = "/elevation_mapping/elevation_map_raw"
POSTPROCESSED = "/elevation_mapping/elevation_map"

WRONG = 0.1
"""Height error above which a cell counts as wrong [m]; moving obstacles leave such cells behind."""


class ElevationMappingReportNode(ReportNode):
    """Node that collects maps for some time and compares the last map with the true terrain."""

    def __init__(self) -> None:
        super().__init__("elevation_mapping_report")
        about = "driving time before the report [s]"
        self._duration = self.read_positive("duration", 10.0, about)
        timeout = self.read_positive("timeout", 60.0, "maximum time to wait for the first map [s]")
        self._counts = {TRUTH: 0, RAW: 0, POSTPROCESSED: 0}
        self._truths: deque[GridMap] = deque(maxlen=200)  # 20 s
        self._estimates: deque[GridMap] = deque(maxlen=100)  # 20 s
        self._begin = 0
        self._subscriptions_of_maps = [
            MapSubscription(self, topic, partial(self._receive, topic)) for topic in self._counts
        ]
        self.give_up_after(self._duration + timeout)

    def silent_topics(self) -> list[str]:
        return [topic for topic, count in self._counts.items() if not count] or [RAW]

    def _receive(self, topic: str, received: ReceivedMap) -> None:
        self._counts[topic] += 1
        if topic == TRUTH:
            self._truths.append(received.decode())
            return
        if topic == POSTPROCESSED:
            self._latest = received.decode()
            return
        estimate = received.decode(["elevation", "variance"])
        self._estimates.append(estimate)
        self._begin = self._begin or estimate.timestamp
        seconds = 1e-9 * (estimate.timestamp - self._begin)
        if seconds < self._duration or 0 in self._counts.values():
            return
        truth = min(self._truths, key=lambda truth: abs(truth.timestamp - estimate.timestamp))
        compared, accuracy = compare(estimate, truth)
        tables: Tables = {
            "Map": {
                "cells": size_of(compared.size),
                "resolution": f"{compared.resolution} m",
                "drive": f"{seconds:.0f} s",
            },
            **accuracy,
            "Person (cells higher than 0.5 m above the ground)": person_rows(
                self._truths, self._estimates, self._begin
            ),
            "Messages per topic": self._counts,
        }
        low, high = np.nanpercentile(compared["truth"], [1, 99])
        heights = {"lower": low, "upper": high, "color_map": "gist_earth", "label": "elevation [m]"}
        shades = {"lower": 0.0, "upper": 1.0, "color_map": "BrBG"}
        shown: Mapping[str, dict[str, Any]] = {
            "truth": {**heights, "title": "True terrain", "hillshade": "truth"},
            "estimate": {**heights, "title": "Estimate", "hillshade": "estimate"},
            "error": {"lower": -0.1, "upper": 0.1, "color_map": "RdBu", "title": "Error"},
            "deviation": {"lower": 0.0, "upper": 0.05, "title": "Claimed standard deviation"},
        }
        pictures = {
            name: (compared, name, {"label": "[m]", **options}) for name, options in shown.items()
        }
        shades["title"] = "Traversability"
        self.finish(
            tables, {**pictures, "traversability": (self._latest, "traversability", shades)}
        )


def compare(estimate: GridMap, truth: GridMap) -> tuple[GridMap, Tables]:
    """Return the layers `truth`, `estimate`, `error` and `deviation` as a map, and accuracy tables.

    `estimate` has the layers `elevation` and `variance`. Both maps are in the same frame.
    """
    positions = estimate.get_positions()
    inside = truth.is_inside(positions)
    heights = np.full(len(positions), np.nan)
    heights[inside] = truth.at_position("elevation", positions[inside], Interpolation.LINEAR)
    compared = GridMap.from_geometry(estimate.geometry, frame_id=estimate.frame_id)
    compared.start_index = estimate.start_index
    compared["truth"] = heights.reshape(estimate.size, order="F")
    compared["estimate"] = estimate["elevation"]
    compared["deviation"] = np.sqrt(estimate["variance"])
    compared["error"] = compared["estimate"] - compared["truth"]
    error = compared.unwrapped("error").astype(np.float64)
    slopes = np.hypot(*np.gradient(compared.unwrapped("truth"), estimate.resolution))
    even = np.isfinite(error) & (slopes < 0.5)
    if not even.any():
        raise NodeFailedError("error: expected known cells on the true terrain, got none")
    offset = float(np.median(error[even]))
    errors = np.abs(error[np.isfinite(error)] - offset)
    limit = np.percentile(np.abs(error[even] - offset), 68)
    claimed = np.median(compared.unwrapped("deviation")[even])
    return compared, {
        "Cells without edges": {
            "68 % of the errors below": f"{1000 * limit:.1f} mm",
            "claimed standard deviation": f"{1000 * claimed:.1f} mm",
            "offset of the map": f"{1000 * offset:.1f} mm",
        },
        "All cells": {
            "known": f"{100 * np.isfinite(error).mean():.0f} %",
            "errors above 10 cm": f"{100 * (errors > WRONG).mean():.1f} %",
        },
    }


def person_rows(truths: deque[GridMap], estimates: deque[GridMap], begin: int) -> dict[str, str]:
    """Return table rows with the times when the person was on the terrain and in the map."""
    # Times are in seconds since `begin` [ns]. `delays` are the times for which cells stay high in
    # the map after the person has left them.
    way = GridMap((40.0, 40.0), estimates[0].resolution, layers={"ground": np.nan, "left": np.nan})
    walk: list[float] = []
    shown: list[float] = []
    delays = [0.0]
    for truth in truths:
        cells = np.nonzero(np.isfinite(truth["person"]))
        places, _ = way.get_indices(truth.get_positions(cells))
        way["ground"][places] = (truth["elevation"] - truth["person"])[cells]
        way["left"][places] = 1e-9 * (truth.timestamp - begin)
        walk.extend(way["left"][places])
    for estimate in estimates:
        places, _ = way.get_indices(estimate.get_positions())
        is_high = estimate["elevation"].ravel("F") - way["ground"][places] > 0.5
        now = 1e-9 * (estimate.timestamp - begin)
        shown.extend(np.full(is_high.sum(), now))
        delays.extend(now - way["left"][places][is_high])
    gap = 1e-9 * np.diff([estimate.timestamp for estimate in estimates]).max(initial=0)
    return {
        "on the terrain": time_span(walk),
        "in the map": f"{time_span(shown)}, maps up to {gap:.1f} s apart",
        "cells left behind": f"high for up to {max(delays):.1f} s",
    }


def time_span(times: list[float]) -> str:
    """Format the first and the last of `times` [s] as text."""
    return f"{min(times):.1f} to {max(times):.1f} s" if times else "never"


# --- large map demo -------------------------------------------------------------------------------

WINDOWS = "/grid_map"
WINDOW_NODE = "grid_map_window"
"""Name of the diagnostic status of the node that publishes the windows."""

MEMORY = "resident memory [MB]"

THINNED = 64  # side of a cell of the overview map [cells of the full map]


class LargeMapReportNode(ReportNode):
    """Node that collects windows of a large map and reports rate, delays and memory use."""

    def __init__(self) -> None:
        super().__init__("large_map_report")
        about = "driving time before the report [s]"
        self._duration = self.read_positive("duration", 20.0, about)
        timeout = self.read_positive("timeout", 60.0, "maximum time to wait for the windows [s]")
        self._times: list[float] = []
        self._delays: list[float] = []
        self._memory: list[float] = []
        sides = [count // THINNED for count in GEOMETRY.size]
        coarse = GridGeometry.from_size((sides[0], sides[1]), THINNED * GEOMETRY.resolution)
        self._overview = GridMap.from_geometry(coarse, layers={LAYER: np.nan}, frame_id="map")
        self._windows = MapSubscription(self, WINDOWS, self._on_window)
        self.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, 10)
        self.give_up_after(self._duration + timeout)

    def silent_topics(self) -> list[str]:
        return [DIAGNOSTICS if self._times else WINDOWS]

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            if status.name == WINDOW_NODE and self._times and MEMORY in values:
                self._memory.append(float(values[MEMORY]))

    def _on_window(self, received: ReceivedMap) -> None:
        now = 1e-9 * self.get_clock().now().nanoseconds
        window = received.decode([LAYER])
        self._times.append(now)
        self._delays.append(1e3 * (now - 1e-9 * window.timestamp))
        self._overview.add_data_from(window, extend_map=False, overwrite_data=True, layers=[LAYER])
        seconds = now - self._times[0]
        if seconds < self._duration or len(self._memory) < 2:
            return
        half, most, worst = np.percentile(self._delays, [50, 95, 100])
        gigabytes = 4e-9 * GEOMETRY.size[0] * GEOMETRY.size[1]
        tables: Tables = {
            "Map on disk": {
                "cells": size_of(GEOMETRY.size),
                "one layer in memory": f"{gigabytes:.1f} GB",
            },
            "Windows": {
                "cells": size_of(window.size),
                "drive": f"{seconds:.0f} s",
                "rate": f"{(len(self._times) - 1) / seconds:.1f} Hz",
                "longest gap": f"{1e3 * np.diff(self._times).max():.0f} ms",
            },
            "From a pose to its window, in another process": {
                "median": f"{half:.1f} ms",
                "95 % below": f"{most:.1f} ms",
                "worst": f"{worst:.1f} ms",
            },
            f"Resident memory of {WINDOW_NODE}": {
                "at the start": f"{self._memory[0]:.1f} MB",
                "in the middle": f"{self._memory[len(self._memory) // 2]:.1f} MB",
                "at the end": f"{self._memory[-1]:.1f} MB",
            },
        }
        colors = {"color_map": "gist_earth", "label": "elevation [m]"}
        way = {**colors, "title": "Windows along the path of the robot"}
        last = {**colors, "title": "The last window"}
        self.finish(tables, {"way": (self._overview, LAYER, way), "window": (window, LAYER, last)})


# --- demos of a robot on its way ------------------------------------------------------------------


class CourseReportNode(ReportNode):
    """Base class of reports on a robot that walks over the true terrain."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.walk: list[Matrix] = []
        self.truth: GridMap | None = None
        self._truths = MapSubscription(self, TRUTH, self._on_truth)
        self.create_subscription(Odometry, "/odom", self._on_odometry, 10)
        self.give_up_after(self.read_positive("timeout", 90.0, "maximum time to wait [s]"))

    def _on_truth(self, received: ReceivedMap) -> None:
        self.truth = received.decode()

    def _on_odometry(self, message: Odometry) -> None:
        self.walk.append(from_pose(message)[:2, 3])


class PathPlannerReportNode(CourseReportNode):
    """Node that collects plans and robot positions until the robot has reached the goal."""

    def __init__(self) -> None:
        super().__init__("path_planner_report")
        self._plans: list[Matrix] = []
        self._costs: GridMap | None = None
        self._maps = MapSubscription(self, POSTPROCESSED, self._on_map)
        self.create_subscription(Path, "/plan", self._on_plan, map_qos())

    def silent_topics(self) -> list[str]:
        got = {TRUTH: self.truth, POSTPROCESSED: self._costs, "/plan": self._plans}
        return [topic for topic, value in got.items() if not value] or ["/odom near the goal"]

    def _on_map(self, received: ReceivedMap) -> None:
        self._costs = received.decode(["inflated_cost"])

    def _on_plan(self, message: Path) -> None:
        if message.poses:
            self._plans.append(np.array([from_pose(pose)[:2, 3] for pose in message.poses]))

    def _on_odometry(self, message: Odometry) -> None:
        super()._on_odometry(message)
        is_there = math.dist(self.walk[-1], GOAL) <= ARRIVED
        if is_there and self.truth and self._costs and self._plans:
            walk = np.array(self.walk)
            lines = {
                "straight line": np.array([START, GOAL]),
                "first plan": self._plans[0],
                "walked path": walk,
            }
            lengths = {
                name: np.hypot(*np.diff(line, axis=0).T).sum() for name, line in lines.items()
            }
            rows = {name: f"{length:.1f} m" for name, length in lengths.items()}
            picture = draw_walk(self.truth, self._costs, self._plans, walk)
            self.finish({"Way to the goal": rows}, {"path_planner": picture})


def draw_walk(truth: GridMap, costs: GridMap, plans: Sequence[Matrix], walk: Matrix) -> Figure:
    """Draw `elevation` and `inflated_cost`, each with the plans (N, 2) and the walked path."""
    figure = Figure((6.4, 2.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    plot(truth, "elevation", left, color_map="gist_earth", hillshade="elevation", scale_bar=False)
    plot(costs, "inflated_cost", right, color_map="RdYlGn_r", label="cost", scale_bar=False)
    for ax in (left, right):
        for number, plan in enumerate(plans):
            label = ("first plan", "later plans")[number] if number < 2 else None
            ax.plot(*plan.T, "--" if number else "-", color="tab:blue", linewidth=1.0, label=label)
        ax.plot(*walk.T, color="magenta", linewidth=1.8, label="walked path")
        ax.plot(*START, "ko", markersize=5)
        ax.plot(*GOAL, "k*", markersize=10)
        ax.set(xlim=(-1.0, 9.5), ylim=(-4.0, 8.0))
    right.legend(fontsize=6, loc="upper right")
    return figure


# --- planar regions demo --------------------------------------------------------------------------

PLANAR = "/planar_map"


class PlanarRegionsReportNode(CourseReportNode):
    """Node that checks the planar regions once the camera has seen the course."""

    def __init__(self) -> None:
        super().__init__("planar_regions_report")
        self._maps = MapSubscription(self, PLANAR, self._on_map)

    def silent_topics(self) -> list[str]:
        got = {TRUTH: self.truth, "/odom at the end": self._is_there()}
        return [topic for topic, value in got.items() if not value] or [PLANAR]

    def _is_there(self) -> bool:
        return any(x >= END for x, _ in self.walk)

    def _on_map(self, received: ReceivedMap) -> None:
        if self.truth is not None and self._is_there():
            regions = received.decode(["elevation", "plane_id", "plane_elevation"])
            rows = found_planes(regions, self.truth)
            rows["regions in all"] = str(len(np.unique(regions["plane_id"])) - 1)
            self.finish({"Planes": rows}, {"planar_regions": draw_regions(regions)})


def found_planes(regions: GridMap, truth: GridMap) -> dict[str, str]:
    """Return table rows with the number of planes found and the largest height errors."""
    rows, known = {}, set[float]()
    for name, centers in PLANES.items():
        places = np.array(centers)
        ids = np.asarray(regions.at_position("plane_id", places))
        heights = np.asarray(regions.at_position("plane_elevation", places, Interpolation.LINEAR))
        true = np.asarray(truth.at_position("elevation", places, Interpolation.LINEAR))
        own = {*ids[ids > 0].tolist()} - known
        known |= own
        errors = 1e3 * np.abs(heights - true)[ids > 0]
        worst = f", heights within {errors.max():.1f} mm" if len(errors) else ""
        rows[name] = f"{len(own)} of {len(ids)}{worst}"
    return rows


def draw_regions(regions: GridMap) -> Figure:
    """Draw the heights of a map, and its planar regions in up to twenty colors."""
    ids = regions["plane_id"]
    # Ranks of the ids, so that fewer than twenty regions have a color each.
    ranks = np.searchsorted(np.unique(ids[ids > 0]), ids)
    colored = regions.with_layers({"color": np.where(ids > 0, ranks % 20, np.nan)})
    figure = Figure((6.4, 5.0), layout="constrained")
    upper, lower = figure.subplots(2, 1)
    options: dict[str, Any] = {"color_bar": False, "scale_bar": False}
    plot(colored, "elevation", upper, color_map="gray", title="mapped heights", **options)
    plot(colored, "color", lower, color_map="tab20", title="planar regions", **options)
    for ax in (upper, lower):
        ax.set(xlim=(0.4, 8.2), ylim=(-1.6, 1.6))
    return figure


REPORTS = {
    "filters": DemoReportNode,
    "elevation_mapping": ElevationMappingReportNode,
    "large_map": LargeMapReportNode,
    "path_planner": PathPlannerReportNode,
    "planar_regions": PlanarRegionsReportNode,
}

if __name__ == "__main__":
    raise SystemExit(REPORTS[sys.argv[1]].main())
