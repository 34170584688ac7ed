# SPDX-License-Identifier: BSD-3-Clause
import pytest

from grid_map_ros_py.nodes._health import LogThrottle


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
    return LogThrottle(log, period=5.0, clock=lambda: log.time)


def test_text_is_logged_again_after_the_period(throttle: LogThrottle, log: Log) -> None:
    for _ in range(12):
        throttle.error("bad map")
        log.time += 1.0
    assert log.lines == ["bad map", *["bad map (and 4 more before)"] * 2]


def test_levels_and_kinds_of_texts_are_throttled_apart(throttle: LogThrottle, log: Log) -> None:
    for number in range(5):
        throttle.error(f"bad map: size: {number}")
        throttle.warning(f"bad map: size: {number}")
        throttle.error(f"bad map: name: {number}")
    assert log.lines == ["bad map: size: 0", "warning: bad map: size: 0", "bad map: name: 0"]


def test_long_differing_texts_do_not_flood_the_log(throttle: LogThrottle, log: Log) -> None:
    for number in range(1000):
        throttle.error(f"found {number}{'ab' * 1000}")
        log.time += 0.01
    assert len(log.lines) == 2 * throttle.LIMIT
    assert {len(line) for line in log.lines} == {500}
