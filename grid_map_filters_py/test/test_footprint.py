# SPDX-License-Identifier: BSD-3-Clause
"""Values under the footprint of a robot, compared with the layers of the core."""

import math

import numpy as np
import pytest
from filter_cases import TO_OUT, filtered, ground, run, step_of
from hypothesis import given, strategies as st

from grid_map_core_py.planning import Footprint, footprint_layer
from grid_map_core_py.testing import grid_maps
from grid_map_filters_py import FilterConfigError

FOOTPRINT = [[0.35, 0.12], [-0.15, 0.12], [-0.15, -0.12], [0.35, -0.05]]


@given(
    grid_maps(max_side=8),
    st.integers(1, 4),
    st.sampled_from(["min", "mean", "max"]),
    st.sampled_from(["worst", "best"]),
    st.sampled_from([{"radius": 0.2}, {"footprint": FOOTPRINT}, {"footprint": str(FOOTPRINT)}]),
)
def test_footprint_combines_the_layers_of_all_directions(
    grid_map, yaws, statistic, directions, robot
):
    params = robot | {"yaws": yaws, "statistic": statistic, "directions": directions}
    found = run("Footprint", grid_map, **TO_OUT, **params)
    assert found.start_index == grid_map.start_index
    outline = Footprint.circle(0.2) if "radius" in robot else Footprint(FOOTPRINT)
    layers = footprint_layer(grid_map, outline, "elevation", yaws, statistic)
    for cell, value in np.ndenumerate(found["out"]):
        values = [float(number) for number in layers[cell] if np.isfinite(number)]
        if directions == "worst" and len(values) < yaws:
            values = []
        choose = min if (statistic == "max") == (directions == "best") else max
        np.testing.assert_equal(float(value), choose(values) if values else np.nan)


@pytest.mark.parametrize(
    ("params", "cells"),
    [
        ({"radius": 0.3 * math.cos(math.pi / 32)}, 3),
        ({"radius": 0.36}, 4),
        ({"footprint": [[1.0, 0.0], [1.05, 0.0], [1.0, 0.02]]}, 10),
        ({"radius": 1e12}, 2**31 - 1),
    ],
)
def test_reach_of_footprints(params, cells):
    assert step_of("Footprint", **TO_OUT, **params).reach(0.1) == cells


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({}, "exactly one of 'footprint' and 'radius'"),
        ({"radius": 1.0, "footprint": FOOTPRINT}, "exactly one of 'footprint' and 'radius'"),
        *(
            ({"radius": value}, r"radius: expected a length > 1e-06 \[m\], got ")
            for value in (0.0, 1e-7, math.nan)
        ),
        ({"radius": 1.0, "yaws": 0}, "'yaws': expected a number of directions >= 1, got 0"),
        ({"radius": 1.0, "statistic": "median"}, "'statistic': expected one of 'min'"),
        ({"radius": 1.0, "directions": "all"}, "'directions': expected one of 'worst'"),
        *(
            ({"footprint": text}, r"'footprint': expected corners \[x, y\] \[m\] in order along")
            for text in ("0.3", "", "[[1, 2", "[[0, 0], [1, 1], [1, 0], [0, 1]]", [[1.0], [2.0]])
        ),
        *(
            ({"footprint": count * "-" + "1"}, r"'footprint': expected corners .* got '---")
            for count in (3000, 100000)  # more nested than Python can parse
        ),
    ],
)
def test_wrong_footprints_are_refused(params, message):
    with pytest.raises(FilterConfigError, match=message):
        filtered("Footprint", ground([[0.0]]), **params)
