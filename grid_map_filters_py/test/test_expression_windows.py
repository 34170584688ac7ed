# SPDX-License-Identifier: BSD-3-Clause
"""Expressions over the windows of a layer."""

import numpy as np
import pytest
from expression_oracle import window_by_window
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from grid_map_filters_py.errors import ExpressionError, FilterError
from grid_map_filters_py.expression import Expression
from grid_map_filters_py.expression._functions import FUNCTIONS

pytestmark = pytest.mark.filterwarnings("error")

EDGES = ["inside", "crop", "empty", "mean"]
STANDARD_DEVIATION = "sqrt(sumOfFinites(square(e - meanOfFinites(e))) ./ numberOfFinites(e))"
KERNEL = "[0,-1,0;-1,5,-1;0,-1,0]"

EXPRESSIONS = [
    # reductions of the finite values
    "meanOfFinites(e)",
    "sumOfFinites(e)",
    "numberOfFinites(e)",
    "minOfFinites(e) + 1",
    STANDARD_DEVIATION,
    "maxOfFinites(abs(e - meanOfFinites(e)))",
    "sumOfFinites(e ./ numberOfFinites(e))",
    "sumOfFinites(2 * e^2 - 1)",
    "meanOfFinites(cwiseMin(e, 0.5))",
    "where(numberOfFinites(e) > 4, meanOfFinites(e), 0)",
    "sumOfFinites(e .* e - e / 2)",
    "sum(e .* (e - meanOfFinites(e)))",
    # functions that replace NaN, so that cropping differs from padding
    "sumOfFinites(2^e)",
    "meanOfFinites(e^0)",
    "meanOfFinites(1^e)",
    "meanOfFinites(isfinite(e))",
    "meanOfFinites(e > 0)",
    "meanOfFinites(where(e > 0, e, 0.25))",
    "sumOfFinites(e * transpose(e))",
    "numberOfFinites(e) ./ (size(e, 0) * size(e, 1))",
    # reductions that include NaN
    "max(e) - min(e)",
    "absmax(e)",
    "mean(square(e))",
    "prod(e)",
    "norm(e)",
    "trace(e)",
    "norm(e - mean(e))",
    "max(sum(e, 1))",
    "mean(mean(e, 0))",
    "min(transpose(e), 1)(0)",
    "max(absmax(e, 0))",
    # indices
    "e(floor(size(e, 0) / 2), floor(size(e, 1) / 2))",
    "e(end, end) - e(0, 0)",
    "numberOfFinites(e(0, :))",
    "e(1, 1)",
    "sum(e(0:1, [1, 0]))",
    # matrices
    f"sumOfFinites({KERNEL} .* e)",
    f"sum(e .* {KERNEL})",
    f"numberOfFinites(e .* {KERNEL})",
    "sumOfFinites([1, nan, inf] .* e(0, :))",
    "sumOfFinites([1, nan, 2; inf, 1, 1; 0, 3, 1] .* e)",
    "sum([1, 2, 1] * e)",
    "[1, 2, 1] * e * [1; 0; -1]",
    "sum(e * e)",
    "sum([e(0, :), [1, e(0, 0)]])",
    "sum(eye(size(e, 0), size(e, 1)) .* e)",
    "max(cwiseMax(e, transpose(e)))",
    "maxOfFinites(where(eye(3), e, -1))",
    # no reduction at all
    "2 + 3",
    "e",
    "-e",
    "[e, e]",
]

values = st.one_of(
    st.integers(-8, 8).map(lambda number: number / 4),
    st.sampled_from([np.nan, np.nan, np.inf, -np.inf]),
)
layers = array_shapes(min_dims=2, max_dims=2, max_side=6).flatmap(
    lambda shape: arrays(np.float32, shape, elements=values)
)


@pytest.mark.parametrize("text", EXPRESSIONS)
@settings(max_examples=12)
@given(
    layer=layers, window_size=st.sampled_from([1, 3, 3, 5, 7]), edge_handling=st.sampled_from(EDGES)
)
def test_windows_equal_a_loop_over_cells(text, layer, window_size, edge_handling):
    if edge_handling == "inside" and window_size > min(layer.shape):
        return  # no cell has a window; this case has its own test
    expression = Expression(text)
    expected = window_by_window(expression, "e", layer, window_size, edge_handling)
    if expected is None:
        with pytest.raises(ExpressionError):
            expression.over_windows("e", layer, window_size, edge_handling)
        return
    result = expression.over_windows("e", layer, window_size, edge_handling)
    np.testing.assert_allclose(result, expected, rtol=1e-5, atol=2e-6)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_treat_nan_as_the_table_says(name):
    function = FUNCTIONS[name]
    letters = "abc"[: function.least]
    if function.keeps_nan:
        for missing in letters:
            layers = {letter: np.full((1, 2), 0.5) for letter in letters}
            layers[missing] = np.array([[0.5, np.nan]])
            result = Expression(f"{name}({', '.join(letters)})")(layers)
            np.testing.assert_array_equal(np.isnan(result), [[False, True]])
    if function.skips_nan:
        reduce = Expression(f"{name}(a)")
        known, padded = np.array([[3.0, -1.0]]), np.array([[3.0, np.nan, -1.0]])
        assert reduce({"a": padded}) == reduce({"a": known})


def terrain(rows=40, columns=50, height=0.0) -> np.ndarray:
    """Return hills of one meter with noise and holes."""
    random = np.random.default_rng(7)
    hills = np.add.outer(np.sin(np.arange(rows) / 9), np.cos(np.arange(columns) / 7))
    layer = height + 0.5 * hills + 0.05 * random.normal(size=hills.shape)
    layer[random.random(layer.shape) < 0.1] = np.nan
    return np.asfortranarray(layer, dtype=np.float32)


@pytest.mark.parametrize("edge_handling", EDGES)
@pytest.mark.parametrize("text", ["meanOfFinites(e)", STANDARD_DEVIATION])
def test_large_map_is_computed_in_tiles_without_seams(monkeypatch, text, edge_handling):
    layer = terrain()
    monkeypatch.setattr("grid_map_filters_py.expression._windows._BLOCK", 200)
    in_parts = Expression(text).over_windows("e", layer, 5, edge_handling)
    monkeypatch.undo()
    np.testing.assert_array_equal(
        in_parts, Expression(text).over_windows("e", layer, 5, edge_handling)
    )


@pytest.mark.parametrize("edge_handling", EDGES)
def test_high_terrain_is_as_accurate_as_at_sea_level(edge_handling):
    high = terrain(height=1000.0)
    at_sea_level = high.astype(np.float64) - 1000.0  # exact, because the values are float32
    for text in [STANDARD_DEVIATION, "max(e) - meanOfFinites(e)", "sumOfFinites(e - e(0, 0))"]:
        over = Expression(text).over_windows
        np.testing.assert_allclose(
            over("e", high, 3, edge_handling),
            over("e", at_sea_level, 3, edge_handling),
            rtol=1e-5,
            atol=1e-6,
        )


@pytest.mark.parametrize("edge_handling", EDGES)
def test_huge_value_affects_only_its_own_windows(edge_handling):
    layer = terrain()
    layer[20, 20] = 1e30
    apart = np.ones(layer.shape, bool)
    apart[18:23, 18:23] = False
    for text in ["meanOfFinites(e)", STANDARD_DEVIATION]:
        spoilt = Expression(text).over_windows("e", layer, 5, edge_handling)
        clean = Expression(text).over_windows("e", terrain(), 5, edge_handling)
        np.testing.assert_array_equal(spoilt[apart], clean[apart])


@pytest.mark.parametrize("edge_handling", EDGES)
def test_a_map_of_one_cell_has_windows(edge_handling):
    cell = np.full((1, 1), 2.5, np.float32)
    mean = Expression("meanOfFinites(e)").over_windows
    assert mean("e", cell, 1, edge_handling) == 2.5
    expected = np.nan if edge_handling == "inside" else 2.5
    np.testing.assert_equal(mean("e", cell, 3, edge_handling).item(), expected)
    if edge_handling == "inside":
        with pytest.raises(ExpressionError, match="this one gives 3 x 3"):
            Expression("e + 1").over_windows("e", cell, 3, edge_handling)


@pytest.mark.parametrize("edge_handling", EDGES)
@pytest.mark.parametrize("order", ["C", "F"])
def test_result_is_float32_and_input_is_unchanged(edge_handling, order):
    layer = np.array(terrain(), order=order)
    before, empty = layer.copy(), np.isnan(layer)
    for text in ["meanOfFinites(e)", "e(0, 0)", "3"]:
        over = Expression(text).over_windows
        result = over("e", layer, 3, edge_handling)
        assert (result.dtype, result.shape) == (np.float32, layer.shape)
        assert result.flags.f_contiguous
        assert not np.shares_memory(result, layer)
        only_there = over("e", layer, 3, edge_handling, compute_empty_cells=False)
        np.testing.assert_array_equal(only_there, np.where(empty, np.float32(np.nan), result))
    np.testing.assert_array_equal(layer, before)
    assert layer.flags.writeable


@pytest.mark.parametrize("shape", [(1, 1), (2, 7), (6, 5)])
def test_huge_cropped_window_covers_the_map(shape):
    layer = np.arange(np.prod(shape), dtype=np.float32).reshape(shape, order="F")
    result = Expression("sum(e)").over_windows("e", layer, 10**6 + 1, "crop")
    np.testing.assert_array_equal(result, np.full(shape, layer.sum()))


@pytest.mark.parametrize(
    ("layer", "window_size", "edge_handling", "message"),
    [
        *(
            (np.ones((4, 5)), 10**6 + 1, edges, "a window of 1000001 cells is too large for a lay")
            for edges in ("inside", "empty", "mean")
        ),
        *(
            (np.ones((4, 5)), size, "crop", f"must be odd and positive, not {size}")
            for size in (0, -1, 2, 4)
        ),
        (np.ones((4, 5)), 3, "wrap", "no edge handling 'wrap'; available: inside, crop"),
        (np.ones(4), 3, "crop", "layer: expected rows and columns, got shape"),
    ],
)
def test_wrong_arguments_are_refused(layer, window_size, edge_handling, message):
    with pytest.raises(FilterError, match=message):
        Expression("sum(e)").over_windows("e", layer, window_size, edge_handling)


ERRORS = [
    (
        "sum(e) + f",
        9,
        "no layer 'f'; available: e (a window expression knows only its input layer)",
    ),
    ("e + 1", 2, "must give a single number, this one gives 3 x 3"),
    ("sum(e, 0)", 0, "must give a single number, this one gives 1 x 3"),
    ("sum([1, 2; 3, 4] .* e)", 17, "the shapes 2 x 2 and 3 x 3 do not match"),
    ("1 + e(3, 0)", 6, "index 3 is out of range; indices go from 0 to 2"),
    ("e(numberOfFinites(e) - 9, 0)", 21, "must not depend on the data"),
    ("sum(zeros(max(e)))", 10, "must not depend on the data"),
    ("sum(0:e(0, 0))", 6, "must not depend on the data"),
]


@pytest.mark.parametrize(("text", "column", "message"), ERRORS)
def test_errors_in_windows_show_the_place(text, column, message):
    with pytest.raises(ExpressionError) as caught:
        Expression(text).over_windows("e", terrain(), 3, "inside")
    first, line, caret = str(caught.value).split("\n")
    assert message in first
    assert line.strip() == text
    assert caret.index("^") - line.index(text) == column
