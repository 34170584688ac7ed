# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Report of the filters demo as text."""

import statistics
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from grid_map_core_py import GridMap


@dataclass
class Report:
    """Counts of messages by topic, milliseconds by filter, latency and files written."""

    topics: Iterable[str]
    counts: dict[str, int] = field(init=False)
    times: dict[str, list[float]] = field(default_factory=dict)
    latency: float = 0.0
    files: list[Path] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.counts = dict.fromkeys(self.topics, 0)

    def add_times(self, milliseconds: Mapping[str, float]) -> None:
        """Add the duration of each filter for one map [ms]."""
        for name, value in milliseconds.items():
            self.times.setdefault(name, []).append(value)

    def missing(self, needed: int) -> list[str]:
        """Return the topics with fewer messages than needed."""
        return [topic for topic, count in self.counts.items() if count < needed]

    def to_text(self, grid_map: GridMap) -> str:
        """Return the report; `grid_map` is the last filtered map."""
        rows, columns = grid_map.size
        medians = {name: statistics.median(values) for name, values in self.times.items()}
        sections = [
            _table(
                "Map",
                {
                    "cells": f"{rows} x {columns} = {rows * columns}",
                    "resolution": f"{grid_map.resolution} m",
                    "layers": f"{len(grid_map.layers)}",
                },
            ),
            _table("Layers", dict.fromkeys(grid_map, "")),
            _table(
                "Milliseconds per filter (median)",
                {name: f"{value:.2f}" for name, value in medians.items()}
                | {"whole chain": f"{sum(medians.values()):.2f}"},
            ),
            _table(
                "End-to-end latency (median)", {"published to filtered": f"{self.latency:.0f} ms"}
            ),
            _table("Messages per topic", {topic: str(n) for topic, n in self.counts.items()}),
            _table("Pictures", {str(path): "" for path in self.files}),
        ]
        return "\n\n".join(sections)


def _table(title: str, rows: Mapping[str, str]) -> str:
    width = max(map(len, rows), default=0)
    lines = [f"  {name:<{width}}  {value:>10}".rstrip() for name, value in rows.items()]
    return "\n".join([title, *lines])
