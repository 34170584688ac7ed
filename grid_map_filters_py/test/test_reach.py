# SPDX-License-Identifier: BSD-3-Clause
"""How far filters say that they look; `test_tiles.py` tests whether it is true."""

import numpy as np
import pytest
from filter_cases import TO_OUT, step_of

from grid_map_filters_py import WHOLE_MAP, FilterChain, FilterError, Step
from grid_map_filters_py._config import StepConfig


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
    assert chain_of(Declares(2), lambda grid_map: grid_map).reach(0.1) == WHOLE_MAP


@pytest.mark.parametrize("reach", [-1, 0.5, np.nan, -np.inf, "3", None])
def test_a_wrong_reach_names_the_filter(reach):
    with pytest.raises(FilterError, match=r"'mine'.*reach: expected a number of cells"):
        chain_of(Declares(reach)).reach(0.1)


@pytest.mark.parametrize(
    ("type_name", "params", "reach"),
    [
        ("MeanInRadius", TO_OUT | {"radius": 0.3}, 3),
        ("MeanInRadius", TO_OUT | {"radius": 0.29}, 2),
        ("MeanInRadius", TO_OUT | {"radius": 1e300}, WHOLE_MAP),
        ("Inpaint", TO_OUT | {"radius": 0.3}, WHOLE_MAP),
        (
            "SlidingWindowMathExpression",
            TO_OUT | {"expression": "max(elevation)", "window_size": 5},
            2,
        ),
        *(
            ("MathExpression", {"expression": text, "output_layer": "out"}, reach)
            for text, reach in [
                ("elevation .* 2", 0),
                ("elevation * elevation", WHOLE_MAP),
                ("mean(elevation)", WHOLE_MAP),
                ("elevation(0, 0)", WHOLE_MAP),
                ("transpose(elevation)", WHOLE_MAP),
            ]
        ),
    ],
)
def test_reaches_count_whole_cells(type_name, params, reach):
    assert FilterChain([step_of(type_name, **params)]).reach(0.1) == reach
