# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `elevation_mapping_report`: compares the map of elevation mapping with the true terrain.

After a while it writes pictures of the true terrain, the estimate, its error, the standard
deviation that the map claims, and the traversability; prints a table, which also says when the
map showed the person, and ends. The exit code is 0 only if all topics delivered.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import storage_errors
from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.errors import NodeFailedError
from grid_map_ros_py.nodes import MapSubscription, steady_timer
from grid_map_visualization_py.pictures import save_picture

from .demo import Demo
from .parts import to_text

Array = npt.NDArray[np.float64]

TRUTH = "/true_terrain"
RAW = "/elevation_mapping/elevation_map_raw"
FILTERED = "/elevation_mapping/elevation_map"

WRONG = 0.1
"""Error [m] of cells that are wrong, such as where an obstacle was a moment ago."""

HIGH = 0.5
"""Height above the ground [m] from which a cell shows the person."""


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
        # Those of the last 20 s.
        self._truths: deque[GridMap] = deque(maxlen=200)
        self._estimates: deque[GridMap] = deque(maxlen=100)
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
    heights = heights_at(truth, estimate.get_positions(), "linear")
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


def heights_at(grid_map: GridMap, positions: Array, interpolation: str) -> Array:
    """Return the heights (N,) at positions (N, 2); NaN beside the map."""
    heights = np.full(len(positions), np.nan)
    inside = grid_map.is_inside(positions)
    heights[inside] = grid_map.at_position("elevation", positions[inside], interpolation)
    return heights


def person_rows(
    truths: Sequence[GridMap], estimates: Sequence[GridMap], begin: int
) -> dict[str, str]:
    """Return rows that say when the maps showed the person, in seconds since `begin` [ns].

    Args:
        truths: true terrains in order of time, with the layer `person` of `RobotCourse.terrain_at`.
        estimates: maps with `elevation`, all of one resolution.
    """
    steps = []
    for truth in reversed(truths):
        cells = np.nonzero(np.isfinite(truth["person"]))
        ground = (truth["elevation"] - truth["person"])[cells]
        times = np.full(len(ground), 1e-9 * (truth.timestamp - begin))
        steps.append(np.column_stack((truth.get_positions(cells), ground, times)))
    samples = np.concatenate(steps)
    # When the person was last seen in each cell of the map.
    indices = np.floor((samples[:, :2] - estimates[0].position) / estimates[0].resolution)
    x, y, ground, left = samples[np.unique(indices, axis=0, return_index=True)[1]].T
    now = np.array([1e-9 * (estimate.timestamp - begin) for estimate in estimates])
    way = np.column_stack((x, y))
    high = np.array([heights_at(each, way, "nearest") for each in estimates]) - ground > HIGH
    delays = np.where(high, now[:, None] - left, 0.0)
    in_view = np.isin(now, samples[:, 3])
    showing = in_view & (high & (delays <= 0)).any(axis=1)
    gap = np.diff(now, prepend=now[0]).max()
    return {
        "in the camera's view": time_span(samples[:, 3]),
        "in the map": time_span(now[high.any(axis=1)]),
        "maps that show it in view": f"{showing.sum()} of {in_view.sum()}, up to {gap:.1f} s apart",
        "cells left behind": f"up to {(delays > 0).sum(axis=1).max()}, "
        f"high for up to {delays.max(initial=0.0):.1f} s",
    }


def time_span(times: Array) -> str:
    """Return the first and the last of times (N,) [s] as text."""
    return f"{times.min():.1f} to {times.max():.1f} s" if len(times) else "never"


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
            f"Person (cells higher than {HIGH} m above the ground)": person,
            "Messages per topic": {**counts},
            "Pictures": dict.fromkeys(files, ""),
        }
    )


if __name__ == "__main__":
    raise SystemExit(ElevationMappingReportNode.main())
