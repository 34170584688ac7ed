# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import dataclass

import pytest

from grid_map_ros_py.nodes import LogThrottle


@dataclass
class FakeClock:
    time: float = 1e6

    def __call__(self) -> float:
        return self.time


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


@pytest.fixture
def throttle(clock: FakeClock) -> LogThrottle:
    return LogThrottle(period=5.0, limit=3, clock=clock)


def test_text_is_logged_again_after_the_period(throttle: LogThrottle, clock: FakeClock) -> None:
    logged_at = []
    for second in range(12):
        clock.time = 100.0 + second
        if throttle.allow("bad map"):
            logged_at.append(second)
    assert logged_at == [0, 5, 10]


def test_texts_that_alternate_are_logged_once_each(throttle: LogThrottle) -> None:
    texts = ["bad map", "worse map"] * 5
    assert [text for text in texts if throttle.allow(text)] == ["bad map", "worse map"]


def test_texts_that_differ_every_time_do_not_flood_the_log(
    throttle: LogThrottle, clock: FakeClock
) -> None:
    assert [k for k in range(100) if throttle.allow(f"found {k}")] == [0, 1, 2]
    clock.time += 5.0
    assert [k for k in range(100) if throttle.allow(f"found {k}")] == [0, 1, 2]


def test_throttled_text_does_not_count_as_logged(throttle: LogThrottle, clock: FakeClock) -> None:
    for k in range(3):
        throttle.allow(f"found {k}")
    assert not throttle.allow("bad map")
    clock.time += 5.0
    assert throttle.allow("bad map")
