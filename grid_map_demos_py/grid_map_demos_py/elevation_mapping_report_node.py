# SPDX-License-Identifier: BSD-3-Clause
"""Node `elevation_mapping_report`: compares the map of elevation mapping with the true terrain.

After a while it writes pictures of the true terrain, the estimate, its error, the standard
deviation that the map claims, and the traversability; prints a table, also of when the map showed
the person, and ends. The exit code is 0 only if all topics delivered.
"""

from collections import deque
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from grid_map_core_py import GridMap, Interpolation
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import storage_errors
from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.errors import NodeFailedError
from grid_map_ros_py.nodes import MapSubscription, steady_timer
from grid_map_visualization_py.pictures import save_picture

from .demo import Demo
from .parts import to_text

TRUTH = "/true_terrain"
RAW = "/elevation_mapping/elevation_map_raw"
FILTERED = "/elevation_mapping/elevation_map"

WRONG = 0.1
"""Error [m] of cells that are wrong, such as where an obstacle was a moment ago."""


class IncompleteReportError(NodeFailedError):
    """A topic has delivered nothing."""


@dataclass(frozen=True)
class Accuracy:
    """Accuracy of a map; lengths in meters.

    Attributes:
        known: share of cells that are known.
        offset: by how much the map is too high.
        error: limit below which 68 % of the errors are without the offset, in cells without edges.
        claimed: median of the standard deviations that the map claims for these cells.
        wrong: share of cells with an error above `WRONG`.
    """

    known: float
    offset: float
    error: float
    claimed: float
    wrong: float


class ElevationMappingReportNode(Demo):
    """Collects maps for some time, then reports on the last ones."""

    def __init__(self) -> None:
        super().__init__("elevation_mapping_report")
        self._directory = self.read_path(
            "output_directory", "demo_output", "folder of the pictures"
        )
        # Fail now instead of after a minute of collecting.
        with storage_errors(self._directory, "made a folder"):
            self._directory.mkdir(parents=True, exist_ok=True)
        duration = self.read_positive("duration", 10.0, "time of driving before the report [s]")
        timeout = self.read_positive("timeout", 60.0, "maximum time to wait for the first map [s]")
        self._counts = {TRUTH: 0, RAW: 0, FILTERED: 0}
        self._truths: deque[GridMap] = deque(maxlen=200)  # 20 s
        self._estimates: deque[GridMap] = deque(maxlen=100)  # 20 s
        self._latest: dict[str, GridMap] = {}
        self._duration, self._begin = duration, 0
        self._subscriptions_of_maps = [
            MapSubscription(self, TRUTH, self._on_truth),
            MapSubscription(self, RAW, self._on_raw),
            MapSubscription(self, FILTERED, self._on_filtered),
        ]
        steady_timer(self, duration + timeout, self._give_up)

    def _on_truth(self, received: ReceivedMap) -> None:
        self._counts[TRUTH] += 1
        self._truths.append(received.decode())

    def _on_filtered(self, received: ReceivedMap) -> None:
        self._counts[FILTERED] += 1
        self._latest[FILTERED] = received.decode()

    def _on_raw(self, received: ReceivedMap) -> None:
        self._counts[RAW] += 1
        estimate = received.decode(["elevation", "variance"])
        self._estimates.append(estimate)
        self._begin = self._begin or estimate.timestamp
        seconds = 1e-9 * (estimate.timestamp - self._begin)
        if seconds < self._duration or 0 in self._counts.values():
            return
        truth = min(self._truths, key=lambda truth: abs(truth.timestamp - estimate.timestamp))
        compared, accuracy = compare(estimate, truth)
        person = person_rows(self._truths, self._estimates, self._begin)
        try:
            with storage_errors(self._directory, "filled with pictures"):
                files = write_pictures(compared, self._latest[FILTERED], self._directory)
        except GridMapError as error:
            raise NodeFailedError(str(error)) from error
        print(report(compared, accuracy, person, seconds, self._counts, files), flush=True)
        self.context.try_shutdown()

    def _give_up(self) -> None:
        silent = [topic for topic, count in self._counts.items() if not count]
        raise IncompleteReportError(f"too few messages on {', '.join(silent) or RAW}")


def compare(estimate: GridMap, truth: GridMap) -> tuple[GridMap, Accuracy]:
    """Return a map with the layers `truth`, `estimate`, `error` and `deviation`, and its accuracy.

    Args:
        estimate: map with `elevation` and `variance`.
        truth: map with the true `elevation`, in the same frame.

    Raises:
        GridMapError: no known cell is on the true terrain.
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
        raise GridMapError("error: expected known cells on the true terrain, got none")
    offset = float(np.median(error[even]))
    errors = np.abs(error[np.isfinite(error)] - offset)
    accuracy = Accuracy(
        known=float(np.isfinite(error).mean()),
        offset=offset,
        error=float(np.percentile(np.abs(error[even] - offset), 68)),
        claimed=float(np.median(compared.unwrapped("deviation")[even])),
        wrong=float((errors > WRONG).mean()),
    )
    return compared, accuracy


def person_rows(truths: deque[GridMap], estimates: deque[GridMap], begin: int) -> dict[str, str]:
    """Return when maps showed the person of the true terrains, in seconds since `begin` [ns]."""
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
    """Return the first and the last of times [s] as text."""
    return f"{min(times):.1f} to {max(times):.1f} s" if times else "never"


def write_pictures(compared: GridMap, filtered: GridMap, folder: Path) -> list[Path]:
    """Write the pictures, and return their paths."""
    low, high = np.nanpercentile(compared["truth"], [1, 99])
    heights = {"lower": low, "upper": high, "color_map": "gist_earth", "label": "elevation [m]"}
    pictures = {
        "truth": ("True terrain", heights | {"hillshade": "truth"}),
        "estimate": ("Estimate", heights | {"hillshade": "estimate"}),
        "error": ("Error", {"lower": -0.1, "upper": 0.1, "color_map": "RdBu", "label": "[m]"}),
        "deviation": ("Claimed standard deviation", {"lower": 0.0, "upper": 0.05, "label": "[m]"}),
    }
    files = [folder / f"{name}.png" for name in (*pictures, "traversability")]
    for file, (name, (title, options)) in zip(files[:-1], pictures.items(), strict=True):
        save_picture(compared, name, file, title=title, **options)
    options = {"lower": 0.0, "upper": 1.0, "color_map": "BrBG", "title": "Traversability"}
    save_picture(filtered, "traversability", files[-1], **options)
    return files


def report(
    compared: GridMap,
    accuracy: Accuracy,
    person: dict[str, str],
    seconds: float,
    counts: dict[str, int],
    files: list[Path],
) -> str:
    """Return the report as text.

    Args:
        compared: map of `compare`.
        accuracy: accuracy of `compare`.
        person: rows of `person_rows`.
        seconds: duration of the drive [s].
        counts: number of messages by topic.
        files: the pictures.
    """
    rows, columns = compared.size
    return to_text(
        {
            "Map": {
                "cells": f"{rows} x {columns} = {rows * columns}",
                "resolution": f"{compared.resolution} m",
                "known": f"{100 * accuracy.known:.0f} %",
                "drive": f"{seconds:.0f} s",
            },
            "Cells without edges": {
                "68 % of the errors below": f"{1000 * accuracy.error:.1f} mm",
                "claimed standard deviation": f"{1000 * accuracy.claimed:.1f} mm",
                "offset of the map": f"{1000 * accuracy.offset:.1f} mm",
            },
            "All cells": {"errors above 10 cm": f"{100 * accuracy.wrong:.1f} %"},
            "Person (cells higher than 0.5 m above the ground)": person,
            "Messages per topic": {**counts},
            "Pictures": dict.fromkeys(files, ""),
        }
    )


if __name__ == "__main__":
    raise SystemExit(ElevationMappingReportNode.main())
