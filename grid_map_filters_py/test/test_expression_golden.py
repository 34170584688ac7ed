# SPDX-License-Identifier: BSD-3-Clause
"""The expression language against the numbers of EigenLab."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from grid_map_filters_py.errors import ExpressionError
from grid_map_filters_py.expression import Expression

with gzip.open(Path(__file__).parent / "golden" / "eigenlab.json.gz", "rt") as file:
    GOLDEN = json.load(file)

VARIABLES = {name: np.array(value, np.float32) for name, value in GOLDEN["variables"].items()}
A, B = VARIABLES["a"], VARIABLES["b"]

DEVIATIONS = {
    # ^ binds tighter than unary minus, and is left-associative
    "-2^2": -4.0,
    "-2^-2": -0.25,
    "2^3^2": 64.0,
    # signs may be repeated, and an operand may have a sign
    "--3": 3.0,
    "+3": 3.0,
    "a ++ b": A + B,
    # matrices may stand inside matrices
    "[a,b]": np.hstack([A, B]),
    # comparisons give 1 and 0
    "a == b": A == B,
    # min propagates NaN
    "min(a)": np.nan,
    # assignment is an error
    "a = b": None,
}
"""Expressions whose result differs from that of C++, and their values."""


@pytest.mark.parametrize(
    "case",
    [case for case in GOLDEN["cases"] if case["expression"] not in DEVIATIONS],
    ids=lambda case: case["expression"],
)
def test_expressions_equal_eigenlab(case):
    if not case["ok"]:
        with pytest.raises(ExpressionError):
            Expression(case["expression"])(VARIABLES)
        return
    result = np.atleast_2d(Expression(case["expression"])(VARIABLES))
    assert result.shape == (case["rows"], case["cols"])
    np.testing.assert_allclose(result, np.array(case["value"]), rtol=2e-6, atol=1e-7)


@pytest.mark.parametrize("text", DEVIATIONS)
def test_deviating_expressions_follow_matlab_and_numpy(text):
    if DEVIATIONS[text] is None:
        with pytest.raises(ExpressionError, match="assignment is not part of the language"):
            Expression(text)
    else:
        np.testing.assert_array_equal(Expression(text)(VARIABLES), DEVIATIONS[text])
