# SPDX-License-Identifier: BSD-3-Clause
"""Durations of the steps of a chain, for `grid-map filter --timing` and the node."""

from collections.abc import Iterator
from dataclasses import dataclass

from grid_map_core_py._commands import table

from ._config import StepConfig
from ._step import Step


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
        return self.total / self.runs


class StepTimes:
    """Observer of chains that collects the durations of their steps; prints as a table.

    Iterating gives a `StepTime` for each step that has run, in the order of the chain.
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

    @property
    def last(self) -> float:
        """Sum of the last durations of all steps [ms]."""
        return sum(time.last for time in self)

    @property
    def mean(self) -> float:
        """Sum of the mean durations of all steps [ms]."""
        return sum(time.mean for time in self)

    def facts(self) -> list[dict[str, object]]:
        """Return the numbers of all steps, for JSON."""
        return [
            {
                "name": time.config.name,
                "type": time.config.type,
                "maps": time.runs,
                "last_ms": time.last,
                "mean_ms": time.mean,
                "max_ms": time.longest,
            }
            for time in self
        ]

    def __str__(self) -> str:
        total = sum(time.total for time in self)
        rows = [["step", "type", "maps", "last ms", "mean ms", "max ms", "share"]]
        for step in self:
            milliseconds = (f"{value:.3f}" for value in (step.last, step.mean, step.longest))
            share = f"{step.total / total:.0%}" if total else ""
            rows.append([step.config.name, step.config.type, str(step.runs), *milliseconds, share])
        rows.append(["sum", "", "", f"{self.last:.3f}", f"{self.mean:.3f}", "", ""])
        return table(rows, numbers=range(2, 7))
