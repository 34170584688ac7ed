# SPDX-License-Identifier: BSD-3-Clause
"""Fixture `measure` of the benchmarks, and the table printed at the end."""

from collections.abc import Callable, Iterator
from typing import Any

import cv2
import pytest
from measuring import Measurement, Result, to_table

RESULTS = pytest.StashKey[dict[str, Result]]()


def pytest_configure(config: pytest.Config) -> None:
    config.stash[RESULTS] = {}
    # The default table has no C++ column; --benchmark-verbose still shows the default table.
    config.option.benchmark_quiet = True


@pytest.fixture(autouse=True)
def one_core() -> Iterator[None]:
    """Use one thread, as in the C++ timings."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield
    cv2.setNumThreads(threads)


@pytest.fixture(params=[200, 400, 1000])
def cells(request: pytest.FixtureRequest) -> int:
    """Side of the map [cells]."""
    return request.param


@pytest.fixture
def measure(benchmark: Any, request: pytest.FixtureRequest) -> Callable[..., Any]:
    """Return a function that times an operation for a row of the table and returns its result."""

    def run(row: str, cells: int, operation: Callable[..., Any], **options: Any) -> Any:
        measurement = Measurement(operation, **options)
        returned = benchmark.pedantic(
            operation, setup=measurement.before_round, rounds=measurement.rounds
        )
        if not benchmark.disabled:
            result = measurement.result(row, cells, benchmark.stats.stats.data)
            benchmark.extra_info |= {"ratio": result.ratio, "yardsticks": result.yardsticks}
            request.config.stash[RESULTS][result.name] = result
        return returned

    return run


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    results = config.stash[RESULTS]
    if results:
        terminalreporter.section("ours and C++ on this machine; a ratio below 1 is faster than C++")
        for line in to_table([*results.values()]):
            terminalreporter.write_line(line)
