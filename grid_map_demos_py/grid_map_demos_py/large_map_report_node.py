# SPDX-License-Identifier: BSD-3-Clause
"""Node `large_map_report`: measures how windows of a large map arrive.

After a while it writes pictures of the way and of the last window, prints rate and delay of the
windows and the memory of the node that publishes them, and ends. The exit code is 0 only if all
topics delivered.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import storage_errors
from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.errors import NodeFailedError
from grid_map_ros_py.nodes import MapSubscription, steady_timer
from grid_map_visualization_py.pictures import save_picture

from .demo import Demo
from .large_site import GEOMETRY, LAYER
from .parts import to_text

WINDOWS = "/grid_map"
DIAGNOSTICS = "/diagnostics"
NODE = "grid_map_window"
"""Name of the diagnostic status of the node that publishes the windows."""

MEMORY = "resident memory [MB]"

THINNED = 64
"""Side of a cell of the overview [cells of the map]."""


class IncompleteReportError(NodeFailedError):
    """A topic has delivered too little."""


class LargeMapReportNode(Demo):
    """Collects windows for some time, then reports on them."""

    def __init__(self) -> None:
        super().__init__("large_map_report")
        about = "folder of the pictures"
        self._directory = self.read_path("output_directory", "demo_output", about)
        # Fail now instead of after the drive.
        with storage_errors(self._directory, "made a folder"):
            self._directory.mkdir(parents=True, exist_ok=True)
        about = "time of driving before the report [s]"
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
        steady_timer(self, self._duration + timeout, self._give_up)

    def _on_window(self, received: ReceivedMap) -> None:
        now = 1e-9 * self.get_clock().now().nanoseconds
        window = received.decode([LAYER])
        self._times.append(now)
        self._delays.append(1e3 * (now - 1e-9 * window.timestamp))
        self._overview.add_data_from(window, extend_map=False, overwrite_data=True, layers=[LAYER])
        if now - self._times[0] < self._duration or len(self._memory) < 2:
            return
        try:
            with storage_errors(self._directory, "filled with pictures"):
                files = write_pictures(self._overview, window, self._directory)
        except GridMapError as error:
            raise NodeFailedError(str(error)) from error
        print(report(window, self._times, self._delays, self._memory, files), flush=True)
        self.context.try_shutdown()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            if status.name == NODE and self._times and MEMORY in values:
                self._memory.append(float(values[MEMORY]))

    def _give_up(self) -> None:
        silent = DIAGNOSTICS if self._times else WINDOWS
        raise IncompleteReportError(f"too few messages on {silent}")


def write_pictures(overview: GridMap, window: GridMap, folder: Path) -> list[Path]:
    """Write the pictures, and return their paths."""
    files = [folder / "way.png", folder / "window.png"]
    colors: dict[str, Any] = {"color_map": "gist_earth", "label": "elevation [m]"}
    title = "Windows on their way over the site"
    save_picture(overview, LAYER, files[0], title=title, **colors)
    save_picture(window, LAYER, files[1], title="The last window", **colors)
    return files


def report(
    window: GridMap,
    times: Sequence[float],
    delays: Sequence[float],
    memory: Sequence[float],
    files: Sequence[Path],
) -> str:
    """Return the report as text.

    Args:
        window: the last window.
        times: when the windows arrived [s].
        delays: time from a pose to the arrival of its window [ms].
        memory: resident memory of the node that publishes them, every second [MB].
        files: the pictures.
    """
    rows, columns = GEOMETRY.size
    half, most, worst = np.percentile(delays, [50, 95, 100])
    seconds = times[-1] - times[0]
    tables: dict[str, Mapping[object, object]] = {
        "Map on disk": {
            "cells": f"{rows} x {columns} = {rows * columns}",
            "one layer in memory": f"{rows * columns * 4e-9:.1f} GB",
        },
        "Windows": {
            "cells": f"{window.size[0]} x {window.size[1]}",
            "drive": f"{seconds:.0f} s",
            "rate": f"{(len(times) - 1) / seconds:.1f} Hz",
            "longest gap": f"{1e3 * np.diff(times).max():.0f} ms",
        },
        "From a pose to its window, in another process": {
            "median": f"{half:.1f} ms",
            "95 % below": f"{most:.1f} ms",
            "worst": f"{worst:.1f} ms",
        },
        f"Resident memory of {NODE}": {
            "at the begin": f"{memory[0]:.1f} MB",
            "in the middle": f"{memory[len(memory) // 2]:.1f} MB",
            "at the end": f"{memory[-1]:.1f} MB",
        },
        "Pictures": dict.fromkeys(files, ""),
    }
    return to_text(tables)


if __name__ == "__main__":
    raise SystemExit(LargeMapReportNode.main())
