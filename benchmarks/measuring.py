# SPDX-License-Identifier: BSD-3-Clause
"""Times of this library and of C++, in units of a yardstick that is measured around each block."""

import json
import statistics
import timeit
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from yardstick import yardstick

CPP = json.loads((Path(__file__).parent / "cpp_times.json").read_text())

BLOCKS = 5
"""Number of timing blocks per operation, each between two yardsticks."""

DRIFT = 1.10
"""Maximum ratio of the two yardsticks around a calm block."""

SECONDS_PER_BLOCK = 0.1
MOST_ROUNDS = 40
COLD = 0.02
"""Duration [s] below which an operation first runs untimed, to fill the caches."""


@dataclass(frozen=True)
class Result:
    """One table row; times in milliseconds."""

    row: str
    cells: int
    ours: float
    yardstick: float
    calm: bool

    @property
    def name(self) -> str:
        """Row and number of cells."""
        return f"{self.row}, {self.cells}"

    @property
    def noise(self) -> str:
        """Remark for the table if no block was calm."""
        return "" if self.calm else "  (the machine was busy)"

    @property
    def cpp(self) -> float | None:
        """Expected C++ time at the current machine speed [ms]; None if C++ was not timed."""
        entry = CPP["rows"].get(self.row, {}).get(str(self.cells))
        if entry is None:
            return None
        ms = entry["min_ms"] if entry.get("contended") else entry["ms"]
        return ms * self.yardstick / CPP["yardstick_ms"]

    @property
    def ratio(self) -> float | None:
        """Our time divided by the C++ time; below 1 is faster than C++."""
        return None if self.cpp is None else self.ours / self.cpp

    @property
    def yardsticks(self) -> float:
        """Our time in yardsticks."""
        return self.ours / self.yardstick


@dataclass
class Measurement:
    """Splits the rounds of pytest-benchmark into blocks and takes a yardstick between blocks.

    Args:
        operation: the timed operation.
        prepare: creates new arguments for every round; not timed.
    """

    operation: Callable[..., Any]
    prepare: Callable[[], tuple[Any, ...]] = tuple
    yardsticks: list[float] = field(default_factory=list)
    rounds_per_block: int = field(init=False)
    _round: int = 0

    def __post_init__(self) -> None:
        # The first call may also import or compile.
        call = lambda: self.operation(*self.prepare())  # noqa: E731
        self._seconds = min(timeit.repeat(call, number=1, repeat=2))
        wanted = int(SECONDS_PER_BLOCK / self._seconds)
        self.rounds_per_block = max(1, min(MOST_ROUNDS, wanted))

    @property
    def rounds(self) -> int:
        return BLOCKS * self.rounds_per_block

    def before_round(self) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """Take a yardstick if a block begins, and return the arguments of the operation."""
        if self._round % self.rounds_per_block == 0:
            self.yardsticks.append(yardstick())
            if self._seconds < COLD:
                self.operation(*self.prepare())
        self._round += 1
        return self.prepare(), {}

    def result(self, row: str, cells: int, seconds: list[float]) -> Result:
        """Return the median block in yardsticks, among the calm blocks if there are any."""
        self.yardsticks.append(yardstick())
        blocks = [self._block(row, cells, seconds, number) for number in range(BLOCKS)]
        chosen = [block for block in blocks if block.calm] or blocks
        return sorted(chosen, key=lambda block: block.yardsticks)[(len(chosen) - 1) // 2]

    def _block(self, row: str, cells: int, seconds: list[float], number: int) -> Result:
        first = number * self.rounds_per_block
        ours = 1e3 * statistics.median(seconds[first : first + self.rounds_per_block])
        around = self.yardsticks[number : number + 2]
        calm = max(around) <= DRIFT * min(around)
        return Result(row, cells, ours, statistics.mean(around), calm)


def to_table(results: list[Result]) -> list[str]:
    """Return the lines of a table with one row per result."""
    width = max(len(result.row) for result in results)
    lines = [f"{'':{width}}  cells    ours [ms]     C++ [ms]   ratio   yardsticks"]
    for result in results:
        cpp = "-" if result.cpp is None else f"{result.cpp:.4f}"
        ratio = "-" if result.ratio is None else f"{result.ratio:.2f}"
        lines.append(
            f"{result.row:{width}}  {result.cells:5}  {result.ours:11.4f}  {cpp:>11}  {ratio:>6}"
            f"  {result.yardsticks:11.4f}{result.noise}"
        )
    return lines
