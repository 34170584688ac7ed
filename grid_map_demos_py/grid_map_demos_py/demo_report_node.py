# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_demo_report`: collects the messages of the filters demo and reports on them.

Waits for a number of messages on every topic, writes two pictures, prints a table and ends. The
exit code is 0 only if every topic delivered in time.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import storage_errors
from grid_map_core_py.plugins import check
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.errors import NodeFailedError
from grid_map_ros_py.nodes import MapSubscription, map_qos, steady_timer
from grid_map_visualization_py.pictures import save_picture

from .demo import Demo
from .parts import to_text

INPUT = "/grid_map"
OUTPUT = "/filtered_map"
DIAGNOSTICS = "/diagnostics"
FILTER_CHAIN = "grid_map_filters"
"""Name of the diagnostic status of the filter chain."""

SHOWN = {
    "/elevation_points": PointCloud2,
    "/traversability_grid": OccupancyGrid,
    "/surface_normals": Marker,
    "/map_region": Marker,
}
"""Topics of the visualization and their types."""


class IncompleteDemoError(NodeFailedError):
    """A topic of the demo has delivered too few messages."""


class DemoReportNode(Demo):
    """Subscribes to all topics of the demo, and ends after enough messages."""

    def __init__(self) -> None:
        super().__init__("grid_map_demo_report")
        about = "folder of the pictures"
        self._directory = self.read_path("output_directory", "demo_output", about)
        # Fail now instead of after a minute of collecting.
        with storage_errors(self._directory, "made a folder"):
            self._directory.mkdir(parents=True, exist_ok=True)
        self._needed = self.read("messages", 3, "number of messages to wait for on every topic")
        check(self._needed >= 1, "messages", "at least 1", self._needed)
        self._counts = dict.fromkeys([INPUT, OUTPUT, DIAGNOSTICS, *SHOWN], 0)
        self._times: dict[str, list[float]] = {}
        self._latencies: list[float] = []
        self._filtered: GridMap | None = None
        for topic, message_type in {INPUT: GridMapMessage, **SHOWN}.items():
            # Raw messages are counted without converting them to Python.
            count = partial(self._count, topic)
            self.create_subscription(message_type, topic, count, map_qos(), raw=True)
        self._filtered_maps = MapSubscription(self, OUTPUT, self._on_filtered)
        self.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, 10)
        self._timeout = self.read_positive("timeout", 60.0, "maximum time to wait [s]")
        steady_timer(self, self._timeout, self._give_up)

    def _on_filtered(self, received: ReceivedMap) -> None:
        self._filtered = received.decode()
        now = self.get_clock().now().nanoseconds
        self._latencies.append(1e-6 * (now - self._filtered.timestamp))
        self._count(OUTPUT)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        # All nodes of a robot publish on this topic.
        for status in message.status:
            if status.name == FILTER_CHAIN:
                times = [(v.key[3:], v.value) for v in status.values if v.key.startswith("ms ")]
                with suppress(ValueError):  # Another program may report text.
                    for name, milliseconds in [(name, float(ms)) for name, ms in times]:
                        self._times.setdefault(name, []).append(milliseconds)
                    self._count(DIAGNOSTICS)

    def _count(self, topic: str, _message: bytes = b"") -> None:
        self._counts[topic] += 1
        if self._filtered is None or self._missing():
            return
        try:
            with storage_errors(self._directory, "filled with pictures"):
                files = write_pictures(self._filtered, self._directory)
        except GridMapError as error:
            raise NodeFailedError(str(error)) from error
        latency = median(self._latencies)
        print(report(self._filtered, self._times, latency, self._counts, files), flush=True)
        self.context.try_shutdown()

    def _missing(self) -> list[str]:
        return [topic for topic, count in self._counts.items() if count < self._needed]

    def _give_up(self) -> None:
        raise IncompleteDemoError(
            f"after {self._timeout:g} s too few messages on {', '.join(self._missing())}; "
            f"received: {self._counts}"
        )


def write_pictures(grid_map: GridMap, folder: Path) -> list[Path]:
    """Write the pictures of a filtered map, and return their paths."""
    elevation, traversability = (folder / f"{name}.png" for name in ("elevation", "traversability"))
    title = "Published elevation; holes are white"
    shown: dict[str, Any] = {"title": title, "label": "elevation [m]", "exaggeration": 1.5}
    shown |= {"hillshade": "elevation_inpainted", "color_map": "gist_earth"}
    save_picture(grid_map, "elevation", elevation, **shown)
    relief: dict[str, Any] = {"style": "relief", "exaggeration": 1.3}
    relief |= {"color_layer": "traversability", "color_map": "BrBG", "lower": 0.2, "upper": 1.0}
    save_picture(grid_map, "elevation_inpainted", traversability, **relief)
    return [elevation, traversability]


def report(
    grid_map: GridMap,
    times: Mapping[str, Sequence[float]],
    latency: float,
    counts: Mapping[str, int],
    files: Sequence[Path],
) -> str:
    """Return the report as text.

    Args:
        grid_map: the last filtered map.
        times: durations of each filter, one per map [ms].
        latency: time from the publication of a map to its filtered map [ms].
        counts: number of messages by topic.
        files: the pictures.
    """
    rows, columns = grid_map.size
    medians = {name: median(values) for name, values in times.items()}
    medians["whole chain"] = sum(medians.values())
    tables: dict[str, Mapping[Any, object]] = {
        "Map": {
            "cells": f"{rows} x {columns} = {rows * columns}",
            "resolution": f"{grid_map.resolution} m",
            "layers": len(grid_map.layers),
        },
        "Layers": dict.fromkeys(grid_map, ""),
        "Milliseconds per filter (median)": {n: f"{value:.2f}" for n, value in medians.items()},
        "End-to-end latency (median)": {"published to filtered": f"{latency:.0f} ms"},
        "Messages per topic": {**counts},
        "Pictures": dict.fromkeys(files, ""),
    }
    return to_text(tables)


if __name__ == "__main__":
    raise SystemExit(DemoReportNode.main())
