# SPDX-License-Identifier: BSD-3-Clause
"""Values as colors."""

import matplotlib
import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as arrays

from grid_map_core_py import color_vector_to_value
from grid_map_core_py.errors import ConfigError
from grid_map_visualization_py.colors import MISSING, Coloring, color_map_names

FLOATS = st.floats(width=32)


def values(*numbers: float) -> np.ndarray:
    return np.array(numbers, np.float32)


@given(arrays.arrays(np.float32, st.integers(1, 20), elements=FLOATS))
def test_values_get_colors_of_the_map_and_nan_gray(numbers):
    colors = Coloring(color_map="turbo")(numbers)
    assert (colors.shape, colors.dtype) == ((*numbers.shape, 3), np.uint8)
    assert (colors[np.isnan(numbers)] == MISSING).all()
    turbo = matplotlib.colormaps["turbo"](np.arange(256))
    table = {tuple(c[:3]) for c in np.rint(255 * turbo)}
    assert {tuple(color) for color in colors[~np.isnan(numbers)]} <= table


@given(st.lists(st.floats(-100, 100, width=32), min_size=2))
def test_larger_values_are_further_up_the_color_map(numbers):
    order = sorted(numbers)
    gray = Coloring(color_map="gray")(values(*order))[:, 0].astype(int)
    assert (np.diff(gray) >= 0).all()
    if order[0] < order[-1]:
        assert (gray[0], gray[-1]) == (0, 255)


def test_range_is_divided_into_equal_steps():
    ramp = np.arange(256, dtype=np.float32) + 0.5
    gray = Coloring(color_map="gray", lower=0, upper=256)(ramp)
    assert (gray == np.arange(256)[:, None]).all()
    assert (Coloring(color_map="gray", lower=0, upper=256, invert=True)(ramp) == 255 - gray).all()


def test_values_beyond_the_bounds_have_the_colors_of_the_ends():
    gray = Coloring(color_map="gray", lower=-1, upper=1)
    assert gray(values(-np.inf, -5, -1, 1, 5, np.inf))[:, 0].tolist() == [0, 0, 0, 255, 255, 255]


@pytest.mark.parametrize(
    ("given_bounds", "numbers", "expected"),
    [
        ({}, (1, np.nan, 3, -np.inf), (1, 3)),
        ({}, (np.nan, np.inf), (0, 0)),
        ({}, (), (0, 0)),
        ({"lower": 2}, (1, 3), (2, 3)),
        ({"lower": 5}, (1, 3), (5, 5)),
        ({"upper": 2}, (1, 3), (1, 2)),
        ({"upper": 0}, (1, 3), (0, 0)),
        ({"upper": 4}, (np.nan,), (4, 4)),
        ({"lower": 0, "upper": 9}, (1, 3), (0, 9)),
    ],
)
def test_default_bounds_are_the_range_of_finite_values(given_bounds, numbers, expected):
    assert Coloring(**given_bounds).bounds(values(*numbers)) == expected


def test_equal_values_are_at_the_lower_end():
    assert (Coloring(color_map="gray")(values(3, 3)) == 0).all()


def test_packed_colors_are_unpacked_and_gray_where_missing():
    packed = np.append(color_vector_to_value([(1, 2, 3), (255, 254, 253)]), np.float32(np.nan))
    expected = [[1, 2, 3], [255, 254, 253], [MISSING] * 3]
    assert Coloring("color")(packed).tolist() == expected


def test_flat_coloring_gives_one_color_to_every_cell():
    assert Coloring("flat", color=0x010203)(values(5, np.nan)).tolist() == [[1, 2, 3]] * 2


def test_names_equal_matplotlib_without_reversed_ones():
    names = color_map_names()
    assert {"viridis", "turbo", "gist_earth", "gray"} <= {*names} <= {*matplotlib.colormaps}
    assert not [name for name in names if name.endswith("_r")]
    assert names == sorted(names)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"color_map": "viridas"}, ["'color_map'", "'viridas'", "did you mean viridis"]),
        ({"color_map": "###"}, ["'color_map'", "'###'", "turbo"]),
        ({"lower": np.nan}, ["'lower'", "finite", "nan"]),
        ({"upper": np.inf}, ["'upper'", "finite", "inf"]),
        ({"lower": 1.0, "upper": 1.0}, ["'upper'", "more than lower (1.0)", "`invert`", "1.0"]),
    ],
)
def test_mistake_is_one_error_that_names_the_parameter(parameters, words):
    with pytest.raises(ConfigError) as caught:
        Coloring(**parameters)
    for word in words:
        assert word in str(caught.value)
