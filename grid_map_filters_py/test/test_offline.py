# SPDX-License-Identifier: BSD-3-Clause
"""Filter chains over many maps without a node."""

import gc
import weakref

import pytest

from grid_map_core_py import GridMap
from grid_map_core_py.testing import assert_maps_equal
from grid_map_filters_py import (
    FilterChain,
    FilterError,
    filter_maps,
)
from grid_map_filters_py._offline import Failure
from grid_map_filters_py._times import StepTimes

TWICE = {"expression": "2 * height", "output_layer": "height"}
CHAIN = FilterChain.from_config(
    [{"name": "twice", "type": "gridMapFilters/MathExpressionFilter", "params": TWICE}]
)


def a_map(height: float = 1.0, layer: str = "height") -> GridMap:
    return GridMap((1.0, 2.0), 0.5, layers={layer: height})


def heights(filtered) -> list[float]:
    return [float(result.grid_map["height"][0, 0]) for result in filtered]


def test_every_map_is_filtered_and_timed():
    maps, times = [a_map(height) for height in (1.0, 2.0, 3.0)], StepTimes()
    results = list(filter_maps(CHAIN, maps, observer=times))
    assert [(time.config.name, time.runs) for time in times] == [("twice", 3)]
    assert [result.index for result in results] == [0, 1, 2]
    for result, grid_map in zip(results, maps, strict=True):
        assert result.item is grid_map
        assert_maps_equal(result.grid_map, CHAIN(grid_map))


def test_maps_are_freed_before_the_next_one():
    maps: list[weakref.ref[GridMap]] = []
    failures: list[Failure] = []

    def remember(grid_map: GridMap) -> GridMap:
        maps.append(weakref.ref(grid_map))
        return grid_map

    def source():
        for number in range(6):
            assert [reference for reference in maps if reference() is not None] == []
            # Every second map fails.
            yield remember(a_map(number, "height" if number % 2 else "hight"))

    gc.disable()
    try:
        for result in filter_maps(CHAIN, source(), failures=failures):
            remember(result.grid_map)
            del result
    finally:
        gc.enable()
    assert (len(maps), len(failures)) == (9, 3)


def test_first_failure_ends_the_run():
    results = filter_maps(CHAIN, [a_map(), a_map(layer="hight"), a_map()])
    assert heights([next(results)]) == [2.0]
    with pytest.raises(FilterError) as caught:
        next(results)
    text = str(caught.value)
    assert text.startswith(
        "map 1: filter 1 'twice' (gridMapFilters/MathExpressionFilter): no layer 'height'"
    )
    assert isinstance(caught.value.__cause__, FilterError)
    assert next(results, None) is None


def test_failures_are_collected_on_request():
    failures: list[Failure] = []
    maps = {"1.5": a_map(1.5), "b": a_map(layer="hight"), "c": "no map", "4": a_map(4.0)}
    results = list(filter_maps(CHAIN, [*maps, "gone"], load=maps.__getitem__, failures=failures))
    assert [(result.index, result.item) for result in results] == [(0, "1.5"), (3, "4")]
    assert heights(results) == [3.0, 8.0]
    assert [failure.index for failure in failures] == [1, 2, 4]
    assert "no layer 'height'" in failures[0].message
    assert str(failures[1]) == "map 2: expected a GridMap, got str"
    assert str(failures[2]) == "map 4: KeyError: 'gone'"


@pytest.mark.parametrize(("as_source", "total"), [(list, 3), (iter, None)])
def test_progress_is_called_with_count_and_total(as_source, total):
    told = []
    maps = as_source([a_map(), a_map(layer="hight"), a_map()])
    results = filter_maps(
        CHAIN, maps, failures=[], progress=lambda done, of: told.append((done, of))
    )
    next(results)
    assert told == [(1, total)]
    assert len(list(results)) == 1
    assert told == [(1, total), (2, total), (3, total)]
