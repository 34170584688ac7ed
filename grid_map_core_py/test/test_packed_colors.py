# SPDX-License-Identifier: BSD-3-Clause
"""Colors packed into the bits of a float."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

import golden
from grid_map_core_py import GeometryError, color_value_to_vector, color_vector_to_value

COLORS = golden.load("colors")


def bits(value):
    return np.asarray(value, dtype=np.float32).view(np.uint32).tolist()


def packed(red, green, blue):
    """Return the bits of whole numbers, clamped to [0, 255]."""
    red, green, blue = (min(max(channel, 0), 255) for channel in (red, green, blue))
    return red * 65536 + green * 256 + blue


def spills(rgb, largest) -> bool:
    """Beyond the range C++ spills into the neighboring channels."""
    return not all(0 <= channel <= largest for channel in rgb)


def test_integers_pack_as_in_cpp():
    compared = [case for case in COLORS["vector3i_to_value"] if not spills(case["rgb"], 255)]
    assert len(compared) == 14
    for case in compared:
        assert bits(color_vector_to_value(case["rgb"])) == case["float_bits"]
        assert case["uint64_value"] == case["float_bits"]


def test_integers_beyond_the_range_are_clamped():
    colors = [case["rgb"] for case in COLORS["vector3i_to_value"] if spills(case["rgb"], 255)]
    assert len(colors) == 3
    assert bits(color_vector_to_value(colors)) == [packed(*rgb) for rgb in colors]


def test_floats_pack_as_in_cpp():
    cases = COLORS["vector3f_to_float_value"]
    compared = [case for case in cases if not spills(case["rgb"], 1)]
    assert len(compared) == 17
    rgb = np.array([case["rgb"] for case in compared], dtype=np.float32)
    assert bits(color_vector_to_value(rgb)) == [case["float_bits"] for case in compared]


def test_floats_beyond_the_range_are_clamped_and_nan_stays_nan():
    rgbs = [c["rgb"] for c in COLORS["vector3f_to_float_value"] if spills(c["rgb"], 1)]
    assert len(rgbs) == 4
    for rgb in rgbs:
        value = color_vector_to_value(np.array(rgb, dtype=np.float32))
        if np.isnan(rgb).any():
            assert np.isnan(value)
        else:
            channels = np.clip(np.multiply(rgb, 255.0), -1, 256).astype(int).tolist()
            assert bits(value) == packed(*channels)


def test_values_unpack_as_in_cpp():
    cases = COLORS["float_value_to_vector3f"]
    values = np.array([case["float_bits"] for case in cases], np.uint32).view(np.float32)
    # C++ unpacks the bits of NaN.
    known = ~np.isnan(values)
    assert np.count_nonzero(known) == 14
    rgb = color_value_to_vector(values)
    expected = np.array([case["rgb_float"] for case in cases])
    np.testing.assert_allclose(rgb[known], expected[known], rtol=1e-6)
    assert np.isnan(rgb[~known]).all()


def test_integers_unpack_as_in_cpp():
    cases = COLORS["uint64_value_to_vector"]
    assert len(cases) == 16
    for case in cases:
        rgb = color_value_to_vector(case["value"])
        np.testing.assert_allclose(rgb, case["rgb_float"], rtol=1e-6)
        assert np.rint(255 * rgb).tolist() == case["rgb_int"]


@given(st.lists(st.tuples(*[st.integers(0, 255)] * 3), min_size=1))
def test_packing_and_unpacking_is_the_identity(colors):
    values = color_vector_to_value(colors)
    rgb = color_value_to_vector(values)
    assert np.rint(rgb * 255).astype(int).tolist() == [list(color) for color in colors]
    assert bits(color_vector_to_value(rgb)) == bits(values)


@pytest.mark.parametrize("shape", [(3,), (0, 3), (7, 3), (4, 5, 3), (2, 3, 4, 3)])
@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.int64, np.float32, np.float64])
def test_arrays_of_any_shape_pack_like_single_colors(shape, dtype):
    rng = np.random.default_rng(2)
    rgb = rng.integers(-300, 300, shape) if np.dtype(dtype).kind != "f" else rng.random(shape)
    rgb = rgb.astype(dtype)
    values = color_vector_to_value(rgb)
    assert values.shape == shape[:-1]
    singles = [bits(color_vector_to_value(color.tolist())) for color in rgb.reshape(-1, 3)]
    if dtype != np.float32:  # a list would be packed in double precision
        assert np.ravel(bits(values)).tolist() == singles
    assert color_value_to_vector(values).shape == shape


def test_a_color_has_three_components():
    with pytest.raises(GeometryError, match=r"expected shape \(..., 3\), got \(2,\)"):
        color_vector_to_value([0.1, 0.2])
    with pytest.raises(GeometryError, match="rgb: expected numbers"):
        color_vector_to_value(["red", "green", "blue"])
    with pytest.raises(GeometryError, match="value: expected numbers"):
        color_value_to_vector("red")
