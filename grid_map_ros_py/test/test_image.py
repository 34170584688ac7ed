# SPDX-License-Identifier: BSD-3-Clause
import array
from typing import Any

import numpy as np
import pytest
from cpp_golden import cases, to_map
from hypothesis import given, settings, strategies as st
from sensor_msgs.msg import Image
from wire import over_the_wire, set_field

from grid_map_core_py import GridMap, LayerNotFoundError, color_vector_to_value
from grid_map_core_py.testing import assert_maps_equal, grid_maps, moved_in_buffer
from grid_map_ros_py import (
    MessageError,
    add_color_layer_from_image,
    add_layer_from_image,
    from_image,
    to_color_image,
    to_image,
)
from grid_map_ros_py.messages._image import ENCODINGS

IMAGES = cases("images")
COLOR_IMAGES = [(grid_map, case) for grid_map, case in IMAGES if "color_image" in case]
USUAL = [
    *("mono8", "mono16", "rgb8", "bgr8", "rgba8", "bgra8"),
    *("rgb16", "bgr16", "rgba16", "bgra16", "32FC1", "64FC1"),
]


def described(message: Image) -> dict[str, Any]:
    names = ("height", "width", "encoding", "is_bigendian", "step")
    values = {name: getattr(message, name) for name in names}
    return {**values, "data_hex": bytes(message.data).hex()}


def to_message(description: dict[str, Any]) -> Image:
    message = Image(**{name: value for name, value in description.items() if name != "data_hex"})
    message.data = array.array("B", bytes.fromhex(description["data_hex"]))
    return message


def pixels(description: dict[str, Any]) -> np.ndarray:
    """Return the pixels (rows, cols, channels) as floats, colors in the order red, green, blue."""
    encoding = description["encoding"]
    dtype = "<u2" if encoding.endswith("16") else "u1"
    values = np.frombuffer(bytes.fromhex(description["data_hex"]), dtype).astype(float)
    found = values.reshape(description["height"], description["width"], -1)
    if encoding.startswith("bgr"):
        found = found[..., [2, 1, 0, 3][: found.shape[2]]]
    return found


# --- against C++ ----------------------------------------------------------------------------------


def test_images_equal_cpp_both_ways() -> None:
    assert len(IMAGES) == 24
    for grid_map, case in IMAGES:
        layer, encoding, bounds = case["layer"], case["encoding"], (case["lower"], case["upper"])
        message = to_image(grid_map, layer, encoding, *bounds)
        assert described(over_the_wire(message)) == case["image"]
        automatic = over_the_wire(to_image(grid_map, layer, encoding))
        assert described(automatic) == case["auto_range_image"]
        # Our message, which has frame and time, with the bytes that C++ sent.
        position = case["back"]["position"]
        result = from_image(message, "img", grid_map.resolution, *bounds, position=position)
        assert_maps_equal(result, to_map(case["back"]), rtol=1e-6, atol=1e-7)
        if grid_map.start_index == (0, 0):
            add_layer_from_image(grid_map, to_message(case["image"]), "img", *bounds)
            expected = np.array(case["back_into_same_map"]["layers"]["img"])
            np.testing.assert_allclose(grid_map["img"], expected, rtol=1e-6, atol=1e-7)


def test_gray_of_bgr_images_equals_cpp() -> None:
    compared = [c for _, c in COLOR_IMAGES if c["color_image"]["encoding"].startswith("bgr")]
    assert len(compared) == 8
    for case in compared:
        gray = from_image(to_message(case["color_image"]), "gray", 1.0)["gray"]
        expected = np.array(case["gray_layer_from_color_image"]["layers"]["gray"])
        np.testing.assert_allclose(gray, expected, rtol=1e-6)


def test_color_layers_follow_the_channel_order_of_images() -> None:
    assert len(COLOR_IMAGES) == 16
    for grid_map, case in COLOR_IMAGES:
        add_color_layer_from_image(grid_map, to_message(case["color_image"]))
        colors = pixels(case["color_image"])
        largest = 65535 if case["color_image"]["encoding"].endswith("16") else 255
        expected = color_vector_to_value((colors[..., :3] // (largest // 255)).astype(int))
        if colors.shape[2] == 4:
            expected[colors[..., 3] < largest // 2] = np.nan
        np.testing.assert_array_equal(grid_map.unwrapped("color"), expected)


# --- both ways ------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(grid_maps(), st.sampled_from(sorted(ENCODINGS)))
def test_layer_survives_an_image_up_to_quantization(grid_map: GridMap, encoding: str) -> None:
    low, high = -1000.0, 1000.0
    message = over_the_wire(to_image(grid_map, "elevation", encoding, low, high))
    received = from_image(message, "elevation", grid_map.resolution, low, high)
    sent = np.clip(grid_map.unwrapped("elevation"), low, high)
    kind = ENCODINGS[encoding]
    step = (high - low) * {1: 1 / 255, 2: 1 / 65535}.get(kind.dtype.itemsize, 1e-6)
    missing = np.isnan(sent)
    if kind.dtype.kind == "u" and kind.channels < 4:
        # Without alpha, an image cannot mark missing values.
        sent[missing] = low
    np.testing.assert_allclose(received["elevation"], sent, atol=1.1 * step)
    assert received.size == grid_map.size


COLORS = [e for e in ENCODINGS if ENCODINGS[e].channels > 1]


@pytest.mark.parametrize("encoding", COLORS)
def test_colors_survive_the_way_through_an_image(encoding: str) -> None:
    rgb = np.random.default_rng(3).integers(0, 256, (4, 3, 3))
    grid_map = GridMap((4, 3), 1.0, layers={"color": color_vector_to_value(rgb)})
    grid_map["color"][1, 2] = np.nan
    grid_map = moved_in_buffer(grid_map, (3, 1))
    message = over_the_wire(to_color_image(grid_map, encoding=encoding))
    received = GridMap((4, 3), 1.0)
    add_color_layer_from_image(received, message)
    expected = grid_map.unwrapped("color")
    if ENCODINGS[encoding].channels == 3 and ENCODINGS[encoding].dtype.kind == "u":
        expected[np.isnan(expected)] = 0.0
    # Compared as texts, because most colors are numbers too small for a tolerance.
    assert received["color"].view(np.uint32).tolist() == expected.view(np.uint32).tolist()


def sample(encoding: str) -> Image:
    values = np.random.default_rng(7).uniform(-1, 1, (3, 5))
    grid_map = GridMap((3, 5), 1.0, layers={"e": values})
    return to_image(grid_map, "e", encoding, -1, 1)


@pytest.mark.parametrize("padding", [0, 1, 8])
@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("encoding", USUAL)
def test_padding_and_byte_order_of_senders_do_not_matter(
    encoding: str, big_endian: bool, padding: int
) -> None:
    message = sample(encoding)
    expected = from_image(message, "e", 1.0)
    kind = ENCODINGS[encoding].dtype.newbyteorder(">" if big_endian else "<")
    values = np.frombuffer(message.data, ENCODINGS[encoding].dtype).astype(kind)
    rows = [row.tobytes() + b"\xa5" * padding for row in values.reshape(message.height, -1)]
    message.step += padding
    message.data = array.array("B", b"".join(rows))
    message.is_bigendian = int(big_endian)
    assert_maps_equal(from_image(over_the_wire(message), "e", 1.0), expected)


# --- errors ---------------------------------------------------------------------------------------

MALFORMED = {
    "unknown encoding": (
        "encoding",
        "yuv422",
        "encoding: expected one of mono8, .* got 'yuv422'",
    ),
    "no rows": ("height", 0, "height: expected at least one pixel, got 0"),
    "rows overlap": (
        "step",
        9,
        r"step: expected at least 10 bytes \(5 pixels of mono16\), got 9",
    ),
    "too little data": ("step", 11, r"data: expected 33 bytes \(3 rows of 11\), got 30"),
    "too many rows": ("height", 2**32 - 1, "data: expected 42949672950 bytes .*, got 30"),
    "before the epoch": ("header.stamp.sec", -1, r"header\.stamp\.sec: expected no negative"),
}


@pytest.mark.parametrize("kind", MALFORMED)
def test_malformed_image_gets_one_error_that_names_the_field(kind: str) -> None:
    path, value, text = MALFORMED[kind]
    message = sample("mono16")
    set_field(message, path, value)
    with pytest.raises(MessageError, match=text):
        from_image(message, "e", 1.0)


@pytest.mark.parametrize(
    ("convert", "error", "text"),
    [
        (lambda m: to_image(m, "e", "jpeg"), MessageError, "encoding: .* bgra16.* got 'jpeg'"),
        (lambda m: to_color_image(m, "e", "mono8"), MessageError, "one with colors.*got 'mono8'"),
        (lambda m: to_image(m, "slope", "rgb8"), LayerNotFoundError, "'slope'; available: e"),
        (lambda m: to_color_image(m, "slope"), LayerNotFoundError, "'slope'; available: e"),
        *(
            (lambda m, add=add: add(m, sample("mono8"), "image"), MessageError, r"got \(3, 5\)")
            for add in (add_layer_from_image, add_color_layer_from_image)
        ),
    ],
)
def test_invalid_argument_is_named(convert: Any, error: type[Exception], text: str) -> None:
    grid_map = GridMap((5, 3), 1.0, layers={"e": 0.0})
    with pytest.raises(error, match=text):
        convert(grid_map)
    assert grid_map.layers == ("e",)
