# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
import pytest

from grid_map_ros_py.nodes import LogThrottle


class Log:
    """Stand-in for the logger of a node, and a clock."""

    def __init__(self) -> None:
        self.time = 1e6
        self.lines: list[str] = []

    def error(self, text: str) -> None:
        self.lines.append(text)

    def warning(self, text: str) -> None:
        self.lines.append(f"warning: {text}")


@pytest.fixture
def log() -> Log:
    return Log()


@pytest.fixture
def throttle(log: Log) -> LogThrottle:
    return LogThrottle(log, period=5.0, limit=3, clock=lambda: log.time)


def test_text_is_logged_again_after_the_period(throttle: LogThrottle, log: Log) -> None:
    counts = []
    for _ in range(12):
        throttle.error("bad map")
        counts.append(len(log.lines))
        log.time += 1.0
    assert counts == [1] * 5 + [2] * 5 + [3] * 2


def test_texts_that_alternate_are_logged_once_each(throttle: LogThrottle, log: Log) -> None:
    for _ in range(5):
        throttle.error("bad map")
        throttle.warning("worse map")
    assert log.lines == ["bad map", "warning: worse map"]


def test_texts_that_differ_every_time_do_not_flood_the_log(throttle: LogThrottle, log: Log) -> None:
    for k in range(100):
        throttle.error(f"found {k}")
    assert log.lines == ["found 0", "found 1", "found 2"]
    log.time += 5.0
    # A text that was not logged does not count as logged.
    throttle.error("found 99")
    assert log.lines[3:] == ["found 99"]
