# SPDX-License-Identifier: BSD-3-Clause
"""Durations of chain steps, for `grid-map filter --timing` and the node."""

from collections.abc import Iterator
from dataclasses import dataclass

from grid_map_core_py._commands import table

from ._config import StepConfig
from ._step import Step


@dataclass
class StepTime:
    """Durations of one step [ms]: the last, the longest, and the total over all maps."""

    config: StepConfig
    runs: int = 0
    last: float = 0.0
    longest: float = 0.0
    total: float = 0.0

    @property
    def mean(self) -> float:
        """Mean duration over all maps [ms]."""
        return self.total / self.runs


class StepTimes:
    """Chain observer that collects the durations of steps.

    `str` formats the durations as a table. Iteration yields a `StepTime` for each executed step, in
    the order of the chain.
    """

    def __init__(self) -> None:
        self._times: dict[tuple[int, str], StepTime] = {}

    def __call__(self, step: Step, seconds: float) -> None:
        """Record the duration of a step."""
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
        """Return the durations of all steps as JSON-compatible dictionaries."""
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
