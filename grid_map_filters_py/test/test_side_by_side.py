# SPDX-License-Identifier: BSD-3-Clause
"""Parts of a map in several threads, and chains with several threads."""

import signal
import threading
import time
import warnings

import numpy as np
import pytest
from filter_cases import LAYERS, step_of
from filter_strategies import PARAMETERS, assert_same_bits
from hypothesis import given, settings, strategies as st

from grid_map_core_py import GridMap
from grid_map_filters_py import (
    FilterChain,
    FilterConfigError,
    FilterError,
    Step,
    warn,
)
from grid_map_filters_py._config import StepConfig
from grid_map_filters_py.parts import side_by_side

SMALL_PARTS = {
    "_chain._FEWEST_CELLS": 1500,
    "_builtin._bilateral._PIECE": 3000,
    "_builtin._math_expression._CELLS": 1500,
    "parts._blocks.CELLS": 1500,
    "parts._blocks._SIDE": 40,
    "parts._blocks._SHARE": 2,
    "parts._cell_function.CELLS": 1500,
    "parts._normals._PIECE": 300,
}


def chain_of(function, threads=2):
    return FilterChain([Step(StepConfig(1, "mine", "my/Filter"), function)], threads=threads)


@pytest.fixture
def grid_map() -> GridMap:
    return GridMap((100.0, 100.0), 0.1, layers={"elevation": 1.0})


def run_parts(function, parts, grid_map, threads=2, **options):
    """Call a function with parts as a filter of a chain does."""

    def filter_with_parts(given_map):
        side_by_side(function, parts)
        return given_map

    return chain_of(filter_with_parts, threads)(grid_map, **options)


@pytest.mark.parametrize("threads", [2, 3])
def test_as_many_parts_run_at_a_time_as_threads(grid_map, threads):
    barrier = threading.Barrier(threads, timeout=30)
    run_parts(lambda _: barrier.wait(), range(2 * threads), grid_map, threads)


@pytest.mark.parametrize(("side", "threads"), [(1000, 1), (999, 2)])
def test_one_thread_and_small_maps_are_loops(side, threads):
    small = GridMap((0.1 * side, 100.0), 0.1)
    used = []
    run_parts(lambda part: used.append((part, threading.get_ident())), range(9), small, threads)
    assert used == [(part, threading.get_ident()) for part in range(9)]


def test_every_part_is_taken_once(grid_map):
    parts = []
    run_parts(parts.append, iter(range(1000)), grid_map, threads=4)
    assert sorted(parts) == list(range(1000))


@pytest.mark.parametrize("failing", [0, 1])
def test_an_error_of_a_part_ends_the_step(grid_map, failing):
    barrier, begun = threading.Barrier(2, timeout=30), []

    def compute(part):
        begun.append(part)
        if part < 2:
            barrier.wait()
            if part == failing:
                raise ValueError("broken part")
        time.sleep(0.001)

    with pytest.raises(FilterError, match=r"'mine'.*: ValueError: broken part"):
        run_parts(compute, range(2000), grid_map)
    assert len(begun) < 2000


def test_interrupted_step_ends_its_threads(grid_map):
    barrier, ended = threading.Barrier(2, timeout=30), []

    def compute(part):
        barrier.wait()
        if part == 0:
            signal.setitimer(signal.ITIMER_REAL, 0.01)
        interrupted.wait(30)
        ended.append(part)

    def interrupt(*_):
        interrupted.set()
        raise KeyboardInterrupt

    interrupted = threading.Event()
    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            run_parts(compute, range(2), grid_map)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert sorted(ended) == [0, 1]


def test_warnings_name_the_step_in_every_thread(grid_map):
    barrier, texts = threading.Barrier(2, timeout=30), []

    def compute(part):
        barrier.wait()
        warn(f"part {part}")

    run_parts(compute, range(2), grid_map, warnings=texts)
    step = "filter 1 'mine' (my/Filter): part "
    assert sorted(texts) == [f"{step}0", f"{step}1"]


def test_settings_for_errors_hold_in_every_thread(grid_map):
    barrier = threading.Barrier(2, timeout=30)

    def compute(_part):
        barrier.wait()
        np.float32(3e38) * np.float32(10.0)

    with warnings.catch_warnings(), np.errstate(over="ignore"):
        warnings.simplefilter("error")
        run_parts(compute, range(2), grid_map)


def test_parts_of_parts_are_loops(grid_map):
    inner = []
    run_parts(lambda _: side_by_side(inner.append, range(3)), range(4), grid_map)
    assert sorted(inner) == sorted(4 * [0, 1, 2])


@pytest.mark.filterwarnings("ignore::grid_map_filters_py.FilterWarning")
@pytest.mark.parametrize("type_name", PARAMETERS)
@given(data=st.data())
@settings(max_examples=5)
def test_parts_in_threads_give_the_bits_of_the_whole(type_name, data):
    random = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    size = 131, 117
    holed = GridMap(np.multiply(size, 0.05), 0.05)
    for name in LAYERS:
        heights = np.cumsum(random.normal(size=size), axis=0)
        heights[random.random(size) < 0.05] = random.choice([np.nan, np.inf])
        holed[name] = heights
    step = step_of(type_name, **data.draw(PARAMETERS[type_name]))
    expected = FilterChain([step])(holed, warnings=[])
    with pytest.MonkeyPatch.context() as patch:
        for name, value in SMALL_PARTS.items():
            patch.setattr(f"grid_map_filters_py.{name}", value)
        found = FilterChain([step], threads=3)(holed, warnings=[])
    assert_same_bits(found, expected)


@pytest.mark.parametrize("threads", [0, -1, 1.5, True, "2", 1001])
def test_wrong_numbers_of_threads_are_refused(threads):
    with pytest.raises(FilterConfigError, match="threads: expected an integer from 1 to 1000, got"):
        FilterChain([], threads=threads)
