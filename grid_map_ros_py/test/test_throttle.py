# SPDX-License-Identifier: BSD-3-Clause
import pytest

from grid_map_ros_py.nodes import LogThrottle
from grid_map_ros_py.nodes._throttle import flush_logs


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
    for _ in range(12):
        throttle.error("bad map")
        log.time += 1.0
    assert log.lines == ["bad map", *["bad map (and 4 more like this)"] * 2]


def test_causes_that_alternate_are_logged_once_each(throttle: LogThrottle, log: Log) -> None:
    for _ in range(5):
        throttle.error("bad map")
        throttle.warning("worse map")
    assert log.lines == ["bad map", "warning: worse map"]


@pytest.mark.parametrize(
    "text",
    [
        "expected 12, got {}",
        "no layer '{}'",
        "field[{}].size: expected one",
        "/maps/{}: is not there",
        "no name, got {}".format("'{:0>600}'"),
    ],
)
def test_texts_of_one_cause_are_counted_together(
    throttle: LogThrottle, log: Log, text: str
) -> None:
    for k in range(100):
        throttle.error(text.format(k))
    log.time += 5.0
    throttle.flush()
    assert [line.partition(" (and ")[2] for line in log.lines] == ["", "98 more like this)"]


def test_words_that_differ_every_time_do_not_flood_the_log(throttle: LogThrottle, log: Log) -> None:
    for k in range(100):
        throttle.error("found " + "x" * k)
    assert len(log.lines) == 4
    for _ in range(2):
        log.time += 5.0
        flush_logs()
    assert log.lines[4:] == [f"found {'x' * 99} (and 95 more like this)"]
    # Causes are forgotten after a quiet period.
    throttle.error("found")
    assert log.lines[5:] == ["found"]


def test_long_texts_are_cut(throttle: LogThrottle, log: Log) -> None:
    throttle.error("ab" * 10**6)
    assert len(log.lines[0]) == 500
