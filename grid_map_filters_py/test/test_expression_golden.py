# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The expression language against the numbers of the C++ library."""

import gzip
import json
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from expression_oracle import window_by_window

from grid_map_filters_py.errors import ExpressionError, FilterError
from grid_map_filters_py.expression import Expression

DEVIATIONS = {
    "-2^2": "^ binds tighter than unary minus",
    "--3": "signs may be repeated",
    "a ++ b": "an operand may have a sign",
    "[a,b]": "matrices may stand inside matrices",
    "a == b": "there are comparisons",
    "a = b": "assignment is an error",
    "min(a)": "min propagates NaN",
}
"""Expressions with another result than in C++, and the reason in the contract."""


@cache
def golden(family: str) -> Any:
    path = Path(__file__).parent / "golden" / f"{family}.json.gz"
    with gzip.open(path, "rt") as file:
        return json.load(file)


def eigenlab_variables() -> dict[str, np.ndarray]:
    variables = golden("eigenlab")["variables"]
    return {name: np.array(value, np.float32) for name, value in variables.items()}


@pytest.mark.parametrize(
    "case",
    [case for case in golden("eigenlab")["cases"] if case["expression"] not in DEVIATIONS],
    ids=lambda case: case["expression"],
)
def test_expressions_equal_eigenlab(case):
    if not case["ok"]:
        with pytest.raises(ExpressionError):
            Expression(case["expression"])(eigenlab_variables())
        return
    result = np.atleast_2d(Expression(case["expression"])(eigenlab_variables()))
    assert result.shape == (case["rows"], case["cols"])
    np.testing.assert_allclose(result, np.array(case["value"]), rtol=2e-6, atol=1e-7)


def test_every_deviation_has_a_golden_case():
    assert {case["expression"] for case in golden("eigenlab")["cases"]} > DEVIATIONS.keys()


@pytest.mark.parametrize(
    ("text", "value"),
    [("-2^2", -4.0), ("--3", 3.0), ("+3", 3.0), ("2^3^2", 64.0), ("-2^-2", -0.25)],
)
def test_signs_and_powers_follow_matlab(text, value):
    assert Expression(text)({}) == value


def test_an_operand_may_have_a_sign():
    variables = eigenlab_variables()
    np.testing.assert_array_equal(Expression("a ++ b")(variables), variables["a"] + variables["b"])


def test_matrices_may_contain_matrices():
    variables = eigenlab_variables()
    np.testing.assert_array_equal(
        Expression("[a,b]")(variables), np.hstack([variables["a"], variables["b"]])
    )


def test_comparisons_give_one_and_zero():
    variables = {"a": np.float32([[1, 2, np.nan]]), "b": np.float32([[1, 3, np.nan]])}
    np.testing.assert_array_equal(Expression("a == b")(variables), [[1, 0, 0]])


def test_assignment_is_an_error():
    with pytest.raises(ExpressionError, match="assignment is not part of the language"):
        Expression("a = b")


def test_the_minimum_of_a_matrix_with_nan_is_nan():
    assert math.isnan(Expression("min(a)")(eigenlab_variables()))


# --- filters --------------------------------------------------------------------------------------


def layers_of(case) -> dict[str, np.ndarray]:
    """Return the unwrapped layers of the map of a case."""
    layers = golden("filters")["maps"][case["map"]]["layers"]
    return {name: unwrap(values, case) for name, values in layers.items()}


def unwrap(values, case) -> np.ndarray:
    start = golden("filters")["maps"][case["map"]]["start_index"]
    matrix = np.array(values, np.float32)
    return np.asfortranarray(np.roll(matrix, [-start[0], -start[1]], axis=(0, 1)))


def expected_of(case) -> np.ndarray:
    return unwrap(case["result"]["layers"][case["params"]["output_layer"]], case)


def assert_close(result, expected):
    """Compare with a tolerance of 1e-5 of the range of the values."""
    finite = expected[np.isfinite(expected)]
    tolerance = 1e-5 * (np.ptp(finite) if finite.size else 1.0)
    np.testing.assert_allclose(result, expected, rtol=1e-5, atol=tolerance)


def filter_cases(name: str) -> list[Any]:
    cases = [case for case in golden("filters")["cases"] if case["filter"] == name]
    assert cases
    return cases


def case_id(case) -> str:
    return "-".join(str(value) for value in [case["map"], *case["params"].values()])


@pytest.mark.parametrize("case", filter_cases("MathExpressionFilter"), ids=case_id)
def test_math_expressions_equal_cpp(case):
    expression = Expression(case["params"]["expression"])
    if "exception" in case:
        with pytest.raises(ExpressionError):
            expression(layers_of(case))
        return
    result = expression(layers_of(case))
    expected = expected_of(case)
    # C++ keeps a scalar as a 1 x 1 layer.
    assert_close(result if expected.shape != (1, 1) else np.full((1, 1), result), expected)


def windows_of(case) -> np.ndarray:
    params = case["params"]
    layers = layers_of(case)
    return Expression(params["expression"]).over_windows(
        params["input_layer"],
        layers[params["input_layer"]],
        window_size_of(case),
        params["edge_handling"],
        compute_empty_cells=params["compute_empty_cells"],
    )


def window_size_of(case) -> int:
    params = case["params"]
    if "window_length" not in params:
        return params.get("window_size", 3)
    resolution = golden("filters")["maps"][case["map"]]["resolution"]
    cells = math.floor(params["window_length"] / resolution + 0.5)
    return cells if cells % 2 else cells + 1


def deviates(case) -> str | None:
    """Return the reason for a deliberate deviation, or None."""
    params = case["params"]
    if golden("filters")["maps"][case["map"]]["start_index"] != [0, 0]:
        return "moved maps work"
    if params["expression"] == params["input_layer"]:
        return "an expression that gives a matrix is an error"
    if "window_length" in params and params["edge_handling"] == "inside":
        return "windows of one cell start at the first cell"
    return None if params["compute_empty_cells"] else "compute_empty_cells is respected"


def window_cases(deviation: str | None) -> list[Any]:
    cases = filter_cases("SlidingWindowMathExpressionFilter")
    return [case for case in cases if deviates(case) == deviation]


@pytest.mark.parametrize("case", window_cases(None), ids=case_id)
def test_window_expressions_equal_cpp(case):
    if "exception" in case:
        with pytest.raises(ExpressionError):
            windows_of(case)
        return
    assert_close(windows_of(case), expected_of(case))


@pytest.mark.parametrize("case", window_cases("compute_empty_cells is respected"), ids=case_id)
def test_empty_cells_stay_empty_when_asked_for(case):
    layer = layers_of(case)[case["params"]["input_layer"]]
    assert_close(windows_of(case), np.where(np.isnan(layer), np.float32(np.nan), expected_of(case)))


@pytest.mark.parametrize(
    "case", window_cases("windows of one cell start at the first cell"), ids=case_id
)
def test_windows_of_one_cell_cover_the_whole_map(case):
    layer = layers_of(case)[case["params"]["input_layer"]]
    result, expected = windows_of(case), expected_of(case)
    np.testing.assert_array_equal(result, np.where(np.isfinite(layer), layer, np.nan))
    computed = np.isfinite(expected)
    assert_close(result[computed], expected[computed])


@pytest.mark.parametrize(
    "case", window_cases("an expression that gives a matrix is an error"), ids=case_id
)
def test_window_expression_that_gives_a_matrix_is_refused(case):
    with pytest.raises(ExpressionError, match=r"must give a single number, this one gives . x ."):
        windows_of(case)


@pytest.mark.parametrize("case", window_cases("moved maps work"), ids=case_id)
def test_windows_do_not_depend_on_the_start_index(case):
    params, layer = case["params"], layers_of(case)[case["params"]["input_layer"]]
    if window_size_of(case) % 2 == 0:
        with pytest.raises(FilterError, match="must be odd and positive, not 4"):
            windows_of(case)
        return
    arguments = (params["input_layer"], layer, window_size_of(case), params["edge_handling"])
    expected = window_by_window(Expression(params["expression"]), *arguments)
    if expected is None:
        with pytest.raises(ExpressionError):
            windows_of(case)
        return
    assert_close(windows_of(case), expected)
