# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Durations of the steps of a chain."""

from collections.abc import Iterator
from dataclasses import dataclass

from ._chain import Step
from ._config import StepConfig


@dataclass
class StepTime:
    """Durations of one step [ms]: of the last map, the longest one, and the sum over all maps."""

    config: StepConfig
    runs: int = 0
    last: float = 0.0
    longest: float = 0.0
    total: float = 0.0

    @property
    def mean(self) -> float:
        """Mean over all maps [ms]."""
        return self.total / self.runs if self.runs else 0.0


class StepTimes:
    """Collects the durations of the steps of a chain over many maps; prints as a table.

    It is an observer of chains. Iterating gives a `StepTime` for each step that has run, in the
    order of the chain.

    Example:
        >>> from grid_map_core_py import GridMap
        >>> from grid_map_filters_py import FilterChain
        >>> times = StepTimes()
        >>> chain = FilterChain.from_config([{
        ...     "name": "twice", "type": "gridMapFilters/MathExpressionFilter",
        ...     "params": {"expression": "2 * height", "output_layer": "height"}}])
        >>> for height in range(3):
        ...     _ = chain(GridMap((1, 1), 0.5, layers={"height": height}), times)
        >>> [(time.config.name, time.runs, time.mean > 0) for time in times]
        [('twice', 3, True)]
    """

    def __init__(self) -> None:
        self._times: dict[tuple[int, str], StepTime] = {}

    def __call__(self, step: Step, seconds: float) -> None:
        """Add the duration of a step."""
        config = step.config
        time = self._times.setdefault((config.number, config.name), StepTime(config))
        time.last = 1e3 * seconds
        time.runs += 1
        time.longest = max(time.longest, time.last)
        time.total += time.last

    def __iter__(self) -> Iterator[StepTime]:
        return (self._times[key] for key in sorted(self._times))

    def __len__(self) -> int:
        return len(self._times)

    @property
    def last(self) -> float:
        """Sum of the last durations of all steps [ms]."""
        return sum(time.last for time in self)

    @property
    def mean(self) -> float:
        """Sum of the mean durations of all steps [ms]."""
        return sum(time.mean for time in self)

    def __str__(self) -> str:
        total = sum(time.total for time in self)
        rows = [["step", "type", "maps", "last ms", "mean ms", "max ms", "share"]]
        for time in self:
            milliseconds = (f"{value:.3f}" for value in (time.last, time.mean, time.longest))
            share = f"{time.total / total:.0%}" if total else ""
            rows.append([time.config.name, time.config.type, str(time.runs), *milliseconds, share])
        rows.append(["sum", "", "", f"{self.last:.3f}", f"{self.mean:.3f}", "", ""])
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        # Texts are aligned to the left, numbers to the right.
        lines = (
            "  ".join(
                cell.ljust(width) if column < 2 else cell.rjust(width)
                for column, (cell, width) in enumerate(zip(row, widths, strict=True))
            )
            for row in rows
        )
        return "\n".join(line.rstrip() for line in lines)
