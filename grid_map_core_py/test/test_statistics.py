# SPDX-License-Identifier: BSD-3-Clause
"""Statistics of the finite values of an array."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

import golden
from grid_map_core_py import GeometryError
from grid_map_core_py._arrays import (
    max_of_finites,
    mean_of_finites,
    min_of_finites,
    number_of_finites,
    sum_of_finites,
)

FUNCTIONS = {
    "numberOfFinites": number_of_finites,
    "sumOfFinites": sum_of_finites,
    "meanOfFinites": mean_of_finites,
    "minCoeffOfFinites": min_of_finites,
    "maxCoeffOfFinites": max_of_finites,
}
CASES = golden.load("eigen_plugin")["cases"]

anything = st.floats(width=32) | st.sampled_from([np.nan, np.inf, -np.inf])


def oracle(values) -> dict[str, float]:
    finite = [float(value) for value in np.ravel(values) if math.isfinite(value)]
    if not finite:
        return dict.fromkeys(FUNCTIONS, np.nan) | {"numberOfFinites": 0}
    total = math.fsum(finite)
    results = len(finite), total, total / len(finite), min(finite), max(finite)
    return dict(zip(FUNCTIONS, results, strict=True))


def deviates(case) -> bool:
    """C++ counts infinities as finite, and returns 0 as the sum of no values."""
    values = np.array(case["matrix"], dtype=np.float32)
    return bool(np.isinf(values).any()) or not np.isfinite(values).any()


def test_reductions_equal_cpp():
    compared = [case for case in CASES if not deviates(case)]
    assert len(compared) == 5
    for case in compared:
        values = np.array(case["matrix"], dtype=np.float32)
        for name, function in FUNCTIONS.items():
            # C++ sums in float32.
            tolerance = 1e-5 if name in ("sumOfFinites", "meanOfFinites") else 0
            expected = np.float32(case[name])
            np.testing.assert_allclose(function(values), expected, tolerance, err_msg=name)


@pytest.mark.parametrize(
    "case", [case for case in CASES if deviates(case)], ids=lambda case: case["name"]
)
def test_infinities_are_not_finite_and_nothing_has_no_sum(case):
    values = np.array(case["matrix"], dtype=np.float32)
    assert {name: function(values) for name, function in FUNCTIONS.items()} == pytest.approx(
        oracle(values), nan_ok=True
    )


@given(arrays(st.sampled_from([np.float32, np.float64]), array_shapes(), elements=anything))
def test_reductions_skip_values_that_are_not_finite(values):
    expected = oracle(values)
    # A sum of large numbers of both signs has the rounding error of its largest terms.
    finite = values[np.isfinite(values)].astype(np.float64)
    error = 1e-12 * np.abs(finite).sum()
    for name, function in FUNCTIONS.items():
        np.testing.assert_allclose(function(values), expected[name], 1e-12, error, err_msg=name)


@pytest.mark.parametrize("dtype", [np.int8, np.uint16, np.int64, bool, np.float16])
def test_all_real_types_are_accepted(dtype):
    values = np.array([[0, 1, 1], [1, 0, 1]], dtype=dtype)
    results = [function(values) for function in FUNCTIONS.values()]
    assert results == pytest.approx([6, 4, 4 / 6, 0, 1], rel=1e-12)
    assert mean_of_finites([1, 2, np.nan]) == 1.5
    assert sum_of_finites(np.float32(3)) == 3


@pytest.mark.parametrize("infinities", [False, True])
@pytest.mark.parametrize("view", ["whole", "every other row", "transposed"])
def test_statistics_of_large_layers_and_their_views_are_right(view, infinities):
    rng = np.random.default_rng(5)
    values = np.asfortranarray(rng.normal(1e3, 1, (700, 401)).astype(np.float32))
    values[rng.random(values.shape) < 0.1] = np.nan
    if infinities:
        values[3, 4], values[699, 400] = np.inf, -np.inf
    values = {"whole": values, "every other row": values[::2], "transposed": values.T}[view]
    before = values.copy()
    for name, expected in oracle(values).items():
        assert FUNCTIONS[name](values) == pytest.approx(expected, rel=1e-12)
    np.testing.assert_array_equal(values, before)


@pytest.mark.parametrize("function", FUNCTIONS.values())
@pytest.mark.parametrize("values", ["high", None, [1j], [[1], [1, 2]]])
def test_values_that_are_not_numbers_have_no_statistics(function, values):
    with pytest.raises(GeometryError, match="values: expected numbers, got"):
        function(values)
