# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Colours packed into the bits of a float."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import golden
from grid_map_core_py import GeometryError, color_value_to_vector, color_vector_to_value

COLORS = golden.load("colors")


def bits(value):
    return np.asarray(value, dtype=np.float32).view(np.uint32).tolist()


@pytest.mark.parametrize("case", COLORS["vector3i_to_value"], ids=lambda case: str(case["rgb"]))
def test_integers_pack_as_in_cpp(case):
    clamped = [min(max(channel, 0), 255) for channel in case["rgb"]]
    expected = (
        case["float_bits"] if clamped == case["rgb"] else bits(color_vector_to_value(clamped))
    )
    assert bits(color_vector_to_value(case["rgb"])) == expected


@pytest.mark.parametrize(
    "case", COLORS["vector3f_to_float_value"], ids=lambda case: str(case["rgb"])
)
def test_floats_pack_as_in_cpp(case):
    rgb = np.array(case["rgb"], dtype=np.float32)
    # Outside [0, 1] C++ spills into the neighbouring channel (golden README); ours clamps.
    clamped = np.clip(rgb, 0, 1)
    expected = (
        case["float_bits"] if (clamped == rgb).all() else bits(color_vector_to_value(clamped))
    )
    assert bits(color_vector_to_value(rgb)) == expected


@pytest.mark.parametrize(
    "case", COLORS["float_value_to_vector3f"], ids=lambda case: str(case["float_bits"])
)
def test_values_unpack_as_in_cpp(case):
    value = np.uint32(case["float_bits"]).view(np.float32)
    # NaN stays NaN (contract 5); C++ unpacks its bits.
    expected = [np.nan] * 3 if np.isnan(value) else case["rgb_float"]
    np.testing.assert_allclose(color_value_to_vector(value), expected, rtol=1e-6)


@given(st.lists(st.tuples(*[st.integers(0, 255)] * 3), min_size=1))
def test_packing_and_unpacking_is_the_identity(colors):
    rgb = color_value_to_vector(color_vector_to_value(colors))
    assert np.rint(rgb * 255).astype(int).tolist() == [list(color) for color in colors]


def test_nan_stays_nan_and_everything_else_is_clamped():
    values = color_vector_to_value([[np.nan, 0, 0], [2.0, -1.0, np.inf], [0.5, 0.5, 0.5]])
    assert values.dtype == np.float32
    assert np.isnan(values[0])
    assert bits(values[1:]) == [0xFF00FF, 0x7F7F7F]
    assert np.isnan(color_value_to_vector(np.nan)).all()


def test_a_color_has_three_components():
    with pytest.raises(GeometryError, match=r"expected shape \(..., 3\), got \(2,\)"):
        color_vector_to_value([0.1, 0.2])
    with pytest.raises(GeometryError, match="rgb: expected numbers"):
        color_vector_to_value(["red", "green", "blue"])
