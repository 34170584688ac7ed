# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""How long the steps of a chain take."""

from collections.abc import Iterator
from dataclasses import dataclass

from ._chain import Step
from ._config import StepConfig


@dataclass
class StepTime:
    """How long one step took [ms]: for the last map, for the longest, and for all together."""

    config: StepConfig
    runs: int = 0
    last: float = 0.0
    longest: float = 0.0
    total: float = 0.0

    @property
    def mean(self) -> float:
        """Mean over all maps [ms]."""
        return self.total / self.runs if self.runs else 0.0

    def add(self, milliseconds: float) -> None:
        """Count one more map."""
        self.runs += 1
        self.last = milliseconds
        self.longest = max(self.longest, milliseconds)
        self.total += milliseconds


class StepTimes:
    """Collects the times of a chain over any number of maps; prints as a table.

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
        """Take note of a step that has run."""
        config = step.config
        time = self._times.setdefault((config.number, config.name), StepTime(config))
        time.add(1e3 * seconds)

    def __iter__(self) -> Iterator[StepTime]:
        return (self._times[key] for key in sorted(self._times))

    def __len__(self) -> int:
        return len(self._times)

    @property
    def last(self) -> float:
        """Sum over the steps, each for the last map that it got [ms]."""
        return sum(time.last for time in self)

    @property
    def mean(self) -> float:
        """Sum of the means of the steps [ms]."""
        return sum(time.mean for time in self)

    def __str__(self) -> str:
        total = sum(time.total for time in self)
        head = ("step", "type", "maps", "last ms", "mean ms", "max ms", "share")
        return _table([head, *(_row(time, total) for time in self), self._sum()])

    def _sum(self) -> tuple[str, ...]:
        return ("sum", "", "", f"{self.last:.3f}", f"{self.mean:.3f}", "", "")


def _row(time: StepTime, total: float) -> tuple[str, ...]:
    milliseconds = (f"{value:.3f}" for value in (time.last, time.mean, time.longest))
    share = f"{time.total / total:.0%}" if total else ""
    return (time.config.name, time.config.type, str(time.runs), *milliseconds, share)


def _table(rows: list[tuple[str, ...]]) -> str:
    """Return rows with texts to the left (the first two columns) and numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        padded = [
            cell.ljust(width) if column < 2 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(padded).rstrip())
    return "\n".join(lines)
