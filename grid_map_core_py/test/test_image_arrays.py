# SPDX-License-Identifier: BSD-3-Clause
"""Layers as images and images as layers."""

import numpy as np
import pytest
from hypothesis import given

import golden
from grid_map_core_py import (
    GeometryError,
    GridMap,
    LayerNotFoundError,
    color_value_to_vector,
    color_vector_to_value,
)
from grid_map_core_py.conversions import (
    add_color_layer_from_image,
    add_layer_from_image,
    from_image,
    to_color_image,
    to_image,
)
from grid_map_core_py.testing import assert_maps_equal, grid_maps

CONVERTERS = golden.load("converters")
IMAGES = [
    (CONVERTERS["maps"][case["map"]], image)
    for case in CONVERTERS["cases"]
    for image in case["images"]
]
COLOR_IMAGES = [(description, case) for description, case in IMAGES if "color_image" in case]
DTYPES = [np.uint8, np.uint16, np.float32, np.float64]
LARGEST = {np.uint8: 255, np.uint16: 65535, np.float32: 1.0, np.float64: 1.0}
LEVELS = [np.uint8, np.uint16]


def pixel_type(encoding: str) -> type:
    return np.uint16 if encoding.endswith("16") else np.uint8


def channels_of(encoding: str) -> int:
    return 1 if encoding.startswith("mono") else 4 if "a" in encoding else 3


def pixels_of(image) -> np.ndarray:
    encoding = image["encoding"]
    values = np.frombuffer(bytes.fromhex(image["data_hex"]), pixel_type(encoding))
    pixels = values.reshape(image["height"], image["width"], channels_of(encoding))
    return pixels[..., 0] if pixels.shape[2] == 1 else pixels


def order_of(encoding: str) -> str:
    return "bgr" if encoding.startswith("bgr") else "rgb"


@pytest.fixture
def terrain() -> GridMap:
    """A map that has moved, with a hole and both infinities."""
    values = np.random.default_rng(4).uniform(-2, 3, (9, 6))
    values[2, 3], values[4, 4], values[8, 0] = np.nan, np.inf, -np.inf
    grid_map = GridMap((0.9, 0.6), 0.1, (3.0, -2.0), {"elevation": values}, frame_id="map")
    grid_map.start_index = (5, 2)
    return grid_map


# --- against C++ ----------------------------------------------------------------------------------


def test_layers_become_the_images_of_cpp():
    assert len(IMAGES) == 24
    for description, case in IMAGES:
        grid_map = golden.to_map(description)
        encoding = case["encoding"]
        kind = pixel_type(encoding), channels_of(encoding)
        image = to_image(grid_map, case["layer"], *kind, case["lower"], case["upper"])
        np.testing.assert_array_equal(image, pixels_of(case["image"]), err_msg=encoding)
        image = to_image(grid_map, case["layer"], *kind)
        np.testing.assert_array_equal(image, pixels_of(case["auto_range_image"]), err_msg=encoding)


def test_images_become_the_maps_of_cpp():
    assert len(IMAGES) == 24
    for description, case in IMAGES:
        result = from_image(
            pixels_of(case["image"]),
            "img",
            description["resolution"],
            case["lower"],
            case["upper"],
            position=case["back"]["position"],
            frame_id=description["frame_id"],
            timestamp=description["timestamp"],
        )
        assert_maps_equal(result, golden.to_map(case["back"]), rtol=1e-6, atol=1e-7)


def test_layers_from_images_equal_cpp_and_their_source():
    compared = 0
    for description, case in IMAGES:
        grid_map = golden.to_map(description)
        image = pixels_of(case["image"])
        add_layer_from_image(grid_map, image, "img", case["lower"], case["upper"])
        if grid_map.start_index == (0, 0):
            expected = golden.matrix(case["back_into_same_map"]["layers"]["img"])
            np.testing.assert_allclose(grid_map["img"], expected, rtol=1e-6, atol=1e-7)
            compared += 1
        # On moved maps, C++ puts the pixels where they would be if the map had not moved.
        quantum = (case["upper"] - case["lower"]) / np.iinfo(image.dtype).max
        known = np.isfinite(grid_map["elevation"])
        elevation = np.clip(grid_map["elevation"], case["lower"], case["upper"])
        np.testing.assert_allclose(grid_map["img"][known], elevation[known], atol=1.01 * quantum)
    assert (compared, len(IMAGES)) == (12, 24)


def test_gray_of_bgr_images_equals_cpp():
    compared = [c for c in COLOR_IMAGES if c[1]["color_image"]["encoding"].startswith("bgr")]
    assert len(compared) == 8
    for _, case in compared:
        result = from_image(pixels_of(case["color_image"]), "gray", 1.0, 0, 1)
        # On moved maps C++ puts the pixels where they would be if the map had not moved.
        expected = golden.matrix(case["gray_layer_from_color_image"]["layers"]["gray"])
        np.testing.assert_allclose(result["gray"], expected, rtol=1e-6)


def test_the_gray_of_rgb_images_honors_their_order():
    compared = [c for c in COLOR_IMAGES if c[1]["color_image"]["encoding"].startswith("rgb")]
    assert len(compared) == 8
    for _, case in compared:
        image = pixels_of(case["color_image"])
        largest = np.iinfo(image.dtype).max
        gray = from_image(image, "gray", 1.0, 0, largest, order="rgb")["gray"]
        luma = image[..., :3] @ [0.299, 0.587, 0.114]
        known = np.isfinite(gray)
        np.testing.assert_allclose(gray[known], luma[known], atol=0.51)
        if image.shape[2] == 4:
            np.testing.assert_array_equal(known, image[..., 3] >= largest // 2)


def test_color_layers_follow_the_channel_order_of_images():
    assert len(COLOR_IMAGES) == 16
    for description, case in COLOR_IMAGES:
        grid_map = golden.to_map(description)
        image, encoding = pixels_of(case["color_image"]), case["color_image"]["encoding"]
        add_color_layer_from_image(grid_map, image, order=order_of(encoding))
        rgb = image[..., :3] if order_of(encoding) == "rgb" else image[..., 2::-1]
        expected = color_vector_to_value(rgb // (257 if image.dtype == np.uint16 else 1))
        if image.shape[2] == 4:
            expected[image[..., 3] < np.iinfo(image.dtype).max // 2] = np.nan
        np.testing.assert_array_equal(grid_map.unwrapped("color"), expected)


# --- writing --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("lower", "upper"), [(-1.0, 2.0), (2.0, -1.0)])
@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("dtype", DTYPES)
def test_every_pixel_shows_its_cell(terrain, dtype, channels, lower, upper):
    before = terrain.copy()
    image = to_image(terrain, "elevation", dtype, channels, lower, upper)
    assert_maps_equal(terrain, before)
    assert image.dtype == dtype
    assert image.shape == (9, 6) if channels == 1 else (9, 6, channels)
    assert image.flags.c_contiguous
    pixels = image.reshape(9, 6, channels)
    top_left = terrain.position + 0.5 * (terrain.length - terrain.resolution)
    for row, column in np.ndindex(9, 6):
        position = top_left - 0.1 * np.array([row, column])
        value = terrain["elevation"][terrain.get_index(position)]
        share = (min(max(value, -1.0), 2.0) - lower) / (upper - lower)
        pixel = pixels[row, column]
        if np.isnan(value):
            assert (np.isnan(pixel[:3]) if LARGEST[dtype] == 1 else pixel[:3] == 0).all()
        else:
            error = 1e-6 if LARGEST[dtype] == 1 else 1
            assert np.abs(pixel[:3].astype(float) - share * LARGEST[dtype]).max() <= error
        if channels == 4:
            assert pixel[3] == (0 if np.isnan(value) else LARGEST[dtype])


@pytest.mark.parametrize("dtype", LEVELS)
def test_missing_bounds_are_the_range_of_finite_values(terrain, dtype):
    image = to_image(terrain, "elevation", dtype)
    values = terrain.unwrapped("elevation")
    finite = np.isfinite(values)
    assert image[values == values[finite].min()] == 0
    assert image[values == values[finite].max()] == LARGEST[dtype]
    assert image[values == np.inf] == LARGEST[dtype]
    assert image[values == -np.inf] == 0


@pytest.mark.parametrize("value", [np.nan, np.inf, 3.0])
@pytest.mark.parametrize("dtype", DTYPES)
def test_a_layer_without_a_range_is_black(value, dtype):
    grid_map = GridMap((3, 2), 1.0, layers={"flat": value})
    for bounds in ((), (3.0, None), (None, 3.0)):
        image = to_image(grid_map, "flat", dtype, 1, *bounds)
        if np.dtype(dtype).kind != "f":
            assert not image.any()
        elif not bounds:
            np.testing.assert_array_equal(image, np.full((3, 2), value))
        else:
            np.testing.assert_array_equal(
                image, np.full((3, 2), value * 0 if np.isnan(value) else 0)
            )


@pytest.mark.parametrize("order", ["bgr", "rgb"])
@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("dtype", DTYPES)
def test_colors_round_trip_through_color_images(dtype, channels, order):
    rgb = np.random.default_rng(5).integers(0, 256, (7, 5, 3))
    grid_map = GridMap((7, 5), 1.0, layers={"color": color_vector_to_value(rgb)})
    grid_map["color"][3, 4] = np.nan
    grid_map.start_index = (3, 4)
    options = {"order": order} if order == "rgb" else {}  # BGR is the default, as in OpenCV
    image = to_color_image(grid_map, "color", dtype, channels, **options)
    assert image.dtype == dtype
    assert image.shape == (7, 5, channels)
    np.testing.assert_allclose(
        image[1, 2, :3][:: 1 if order == "rgb" else -1] / LARGEST[dtype],
        color_value_to_vector(grid_map.unwrapped("color"))[1, 2],
        rtol=1e-6,
    )
    add_color_layer_from_image(grid_map, image, "again", **options)
    known = ~np.isnan(grid_map["color"])
    np.testing.assert_array_equal(grid_map["again"][known], grid_map["color"][known])
    if channels == 4:
        assert np.isnan(grid_map["again"][~known]).all()
        assert image[0, 0, 3] == 0


# --- reading --------------------------------------------------------------------------------------


@pytest.mark.parametrize("channels", [1, 4])
@pytest.mark.parametrize("dtype", LEVELS)
@given(grid_map=grid_maps(allow_infinity=False))
def test_values_round_trip_through_images_within_a_level(dtype, channels, grid_map):
    lower, upper = -1000.0, 1000.0
    image = to_image(grid_map, "elevation", dtype, channels, lower, upper)
    add_layer_from_image(grid_map, image, "again", lower, upper)
    quantum = (upper - lower) / LARGEST[dtype]
    known = ~np.isnan(grid_map["elevation"])
    if channels == 1:
        assert (grid_map["again"][~known] == lower).all()
    else:
        assert np.isnan(grid_map["again"][~known]).all()
    difference = grid_map["elevation"][known] - grid_map["again"][known]
    assert (np.abs(difference) <= quantum + 1e-3).all()


@given(grid_maps())
def test_float_images_are_exact(grid_map):
    for dtype in (np.float32, np.float64):
        for channels in (1, 3, 4):
            image = to_image(grid_map, "elevation", dtype, channels)
            gray = image if channels == 1 else image[..., 0]
            add_layer_from_image(grid_map, gray, "again")
            np.testing.assert_array_equal(grid_map["again"], grid_map["elevation"])


@pytest.mark.parametrize("dtype", DTYPES)
def test_transparent_pixels_have_no_value(dtype):
    image = np.full((1, 4, 4), 0.5 * LARGEST[dtype]).astype(dtype)
    image[0, :, 3] = (np.array([0, 0.25, 0.75, 1.0]) * LARGEST[dtype]).astype(dtype)
    grid_map = from_image(image, "height", 1.0, 0, 1)
    add_color_layer_from_image(grid_map, image)
    for layer in grid_map:
        assert np.isnan(grid_map[layer]).tolist() == [[True, True, False, False]]
    lenient = from_image(image, "height", 1.0, 0, 1, alpha_threshold=0.2)
    assert np.isnan(lenient["height"]).tolist() == [[True, False, False, False]]
    everything = from_image(image, "height", 1.0, 0, 1, alpha_threshold=0)
    assert not np.isnan(everything["height"]).any()


def test_images_may_be_views_of_any_layout_and_byte_order():
    image = np.random.default_rng(6).integers(0, 65536, (8, 10, 3)).astype(np.uint16)
    expected = from_image(image, "gray", 1.0, 0, 1)["gray"]
    big_endian = image.astype(">u2")
    reversed_twice = image[..., ::-1].copy()[..., ::-1]
    for other in (big_endian, reversed_twice, np.asfortranarray(image)):
        np.testing.assert_array_equal(from_image(other, "gray", 1.0, 0, 1)["gray"], expected)
    turned = from_image(image[::-1, ::2], "gray", 1.0, 0, 1)["gray"]
    np.testing.assert_array_equal(turned, expected[::-1, ::2])
    as_rgb = from_image(image[..., ::-1], "gray", 1.0, 0, 1, order="rgb")["gray"]
    np.testing.assert_allclose(as_rgb, expected, atol=1 / 65535)


def test_gray_images_with_channel_axis_are_accepted():
    image = np.arange(6, dtype=np.uint8).reshape(2, 3)
    grid_map = from_image(image[..., None], "gray", 1.0, 0, 255)
    np.testing.assert_array_equal(grid_map["gray"], image)
    for order in ("bgr", "rgb"):
        add_color_layer_from_image(grid_map, image, order=order)
        np.testing.assert_array_equal(
            grid_map["color"], color_vector_to_value(np.stack(3 * [image], axis=-1))
        )


# --- memory and mistakes --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"dtype": np.int32}, "dtype: expected one of uint8, uint16, float32, float64, got"),
        ({"dtype": "color"}, "dtype: expected one of"),
        ({"channels": 2}, "channels: expected 1, 3 or 4, got 2"),
        ({"lower": 1, "upper": 1}, "lower, upper: expected two different finite float32 numbers"),
        ({"lower": -3e38, "upper": 3e38}, "lower, upper: expected two different finite"),
        ({"lower": np.nan, "upper": 1}, "lower, upper: expected two different finite"),
        ({"lower": "deep", "upper": 1}, "lower: expected a number, got 'deep'"),
        ({"lower": np.nan}, r"two different finite float32 numbers, got \(nan, 2\.9"),
        ({"upper": -np.inf}, r"two different finite float32 numbers, got \(-inf, -inf"),
        ({"layer": "extreme"}, r"float32 numbers, got \(-3\S+e\+38, 3\S+e\+38"),
        ({"layer": "height"}, "no layer 'height'; available: elevation, extreme"),
        ({"order": "gbr"}, "order: expected 'bgr' or 'rgb', got 'gbr'"),
        ({"order": "bgr", "channels": 1}, "channels: expected 3 or 4, got 1"),
        ({"order": "bgr", "layer": "height"}, "no layer 'height'; available: elevation, extreme"),
    ],
)
def test_invalid_arguments_of_images_are_refused(terrain, arguments, message):
    terrain["extreme"] = np.linspace(-3e38, 3e38, 9)[:, None].repeat(6, axis=1)
    convert = to_color_image if "order" in arguments else to_image
    with pytest.raises((GeometryError, LayerNotFoundError), match=message):
        convert(terrain, **{"layer": "elevation"} | arguments)


@pytest.mark.parametrize(
    ("image", "arguments", "message"),
    [
        (None, {}, "which cv2.imread returns for a file it cannot read"),
        ([[1, 2]], {}, "image: expected one of uint8, uint16, float32, float64, got dtype"),
        ([[1.0, 2.0], [3.0]], {}, "image: expected an array of pixels"),
        (np.zeros(4, np.uint8), {}, r"image: expected shape .* got \(4,\)"),
        (np.zeros((9, 6, 2), np.uint8), {}, r"image: expected shape .* got \(9, 6, 2\)"),
        (np.zeros((0, 6), np.uint8), {}, r"image: expected shape .* got \(0, 6\)"),
        (np.zeros((9, 6), np.float32), {"lower": 1}, "lower, upper: expected two different"),
        (np.zeros((9, 6), np.uint8), {"lower": 1, "upper": 1}, "two different finite"),
        (np.zeros((9, 6, 4), np.float32), {"alpha_threshold": 2}, "a number from 0 to 1, got 2"),
        (np.zeros((9, 6, 4), np.float32), {"order": "gbr"}, "order: expected 'bgr' or 'rgb'"),
    ],
)
def test_invalid_image_changes_nothing(terrain, image, arguments, message):
    before = terrain.copy()
    with pytest.raises(GeometryError, match=message):
        from_image(image, "gray", 1.0, **arguments)
    with pytest.raises(GeometryError, match=message):
        add_layer_from_image(terrain, image, "elevation", **arguments)
    for add in (add_layer_from_image, add_color_layer_from_image):
        with pytest.raises(GeometryError, match=r"expected \(9, 6\) pixels.* got \(6, 9\)"):
            add(terrain, np.zeros((6, 9), np.float32), "gray")
    assert_maps_equal(terrain, before)
