# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""How far filters look: cells beyond their reach change nothing."""

from dataclasses import replace

import numpy as np
import pytest
from filter_cases import step_of, terrain
from filter_strategies import PARAMETERS, assert_same_bits, blocks_of, maps
from hypothesis import given, strategies as st

from grid_map_filters_py import WHOLE_MAP, FilterChain, FilterError, Step, StepConfig
from grid_map_filters_py._filter import for_tiles_of
from grid_map_filters_py._registry import BUILT_IN

NEEDS_THE_WHOLE_MAP = {"Inpaint"}
LOCAL_FILTERS = pytest.mark.parametrize(
    "type_name", sorted(PARAMETERS.keys() - NEEDS_THE_WHOLE_MAP)
)


def drawn_step(data, type_name, grid_map) -> tuple[Step, float]:
    """Return a filter with random parameters for parts of a map, and its reach."""
    steps = PARAMETERS[type_name].map(lambda parameters: step_of(type_name, **parameters))
    step = data.draw(steps.filter(lambda step: step.reach(grid_map.resolution) < WHOLE_MAP))
    bound = for_tiles_of(step.filter, grid_map)
    return replace(step, filter=bound), step.reach(grid_map.resolution)


def filtered(step, grid_map):
    return FilterChain([step])(grid_map, warnings=[])


def widened(block, cells, size):
    """Return a block with a border, as far as the map goes."""
    return tuple(
        slice(max(part.start - int(cells), 0), min(part.stop + int(cells), length))
        for part, length in zip(block, size, strict=True)
    )


def test_every_registered_filter_has_random_parameters():
    assert {cls.__name__ for cls in BUILT_IN.values()} == PARAMETERS.keys()


def test_every_registered_filter_declares_how_far_it_looks():
    assert [cls for cls in BUILT_IN.values() if not callable(getattr(cls, "reach", None))] == []


@pytest.mark.parametrize("type_name", sorted(NEEDS_THE_WHOLE_MAP))
@given(data=st.data())
def test_filters_of_whole_maps_say_so(type_name, data):
    assert step_of(type_name, **data.draw(PARAMETERS[type_name])).reach(0.1) == WHOLE_MAP


@LOCAL_FILTERS
@given(data=st.data())
def test_parts_with_a_border_equal_the_whole_map(type_name, data):
    grid_map = data.draw(maps(allow_moved=False))
    step, reach = drawn_step(data, type_name, grid_map)
    whole = filtered(step, grid_map)
    for block in data.draw(st.lists(blocks_of(grid_map), min_size=1, max_size=4)):
        wide = widened(block, reach, grid_map.size)
        part = filtered(step, grid_map.get_block(*wide))
        inner = (
            slice(cells.start - around.start, cells.stop - around.start)
            for cells, around in zip(block, wide, strict=True)
        )
        assert_same_bits(part.get_block(*inner).copy(), whole.get_block(*block).copy())


@LOCAL_FILTERS
@given(data=st.data())
def test_cells_beyond_the_reach_change_nothing(type_name, data):
    grid_map = data.draw(maps(allow_moved=False))
    step, reach = drawn_step(data, type_name, grid_map)
    cell = tuple(data.draw(st.integers(0, length - 1)) for length in grid_map.size)
    one = tuple(slice(place, place + 1) for place in cell)
    near = widened(one, reach, grid_map.size)
    other = data.draw(st.sampled_from(np.float32([0, 5, -3e38, np.inf, np.nan])))
    changed = grid_map.copy()
    for name in changed:
        changed[name][...] = other
        changed[name][near] = grid_map[name][near]
    expected, found = (filtered(step, given) for given in (grid_map, changed))
    assert_same_bits(found.get_block(*one).copy(), expected.get_block(*one).copy())


def chain_of(*functions):
    config = StepConfig(1, "mine", "my/Filter")
    return FilterChain([Step(config, function) for function in functions])


class Declares:
    def __init__(self, cells):
        self.cells = cells

    def reach(self, _resolution):
        return self.cells

    def __call__(self, grid_map):
        return grid_map


def test_chains_add_up_what_their_filters_declare():
    assert chain_of().reach(0.1) == 0
    assert chain_of(Declares(2), Declares(0), Declares(3)).reach(0.1) == 5
    assert chain_of(Declares(2), Declares(WHOLE_MAP)).reach(0.1) == WHOLE_MAP


def test_filters_without_a_declaration_look_at_the_whole_map():
    assert chain_of(lambda grid_map: grid_map).reach(0.1) == WHOLE_MAP


def test_a_parameter_called_reach_is_no_declaration():
    function = Declares(1)
    function.reach = 3.0
    assert chain_of(function).reach(0.1) == WHOLE_MAP


@pytest.mark.parametrize("reach", [-1, 0.5, np.nan, -np.inf, "3", None])
def test_a_wrong_reach_names_the_filter(reach):
    with pytest.raises(FilterError, match=r"'mine'.*reach: expected a number of cells"):
        chain_of(Declares(reach)).reach(0.1)


@pytest.mark.parametrize(
    ("type_name", "params", "reach"),
    [
        ("MeanInRadius", {"radius": 0.3}, 3),
        ("MeanInRadius", {"radius": 0.29}, 2),
        ("MeanInRadius", {"radius": 1e300}, WHOLE_MAP),
        ("SlidingWindowMathExpression", {"expression": "max(elevation)", "window_size": 5}, 2),
    ],
)
def test_reaches_count_whole_cells(type_name, params, reach):
    step = step_of(type_name, input_layer="elevation", output_layer="out", **params)
    assert FilterChain([step]).reach(0.1) == reach


@pytest.mark.parametrize(
    ("expression", "reach"),
    [
        ("elevation .* 2", 0),
        ("elevation * elevation", WHOLE_MAP),
        ("mean(elevation)", WHOLE_MAP),
        ("elevation(0, 0)", WHOLE_MAP),
        ("transpose(elevation)", WHOLE_MAP),
    ],
)
def test_expressions_of_whole_layers_look_at_the_whole_map(expression, reach):
    step = step_of("MathExpression", expression=expression, output_layer="out")
    assert FilterChain([step]).reach(0.1) == reach


def test_layers_that_hide_a_constant_need_the_whole_map():
    step = step_of("MathExpression", expression="pi + elevation", output_layer="out")
    assert for_tiles_of(step.filter, terrain(elevation=1.0)) is not None
    assert for_tiles_of(step.filter, terrain(elevation=1.0, pi=2.0)) is None
