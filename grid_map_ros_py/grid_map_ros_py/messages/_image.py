# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between grid maps and `sensor_msgs/Image`."""

import array
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap, conversions as pixels
from grid_map_core_py._arrays import Size
from grid_map_core_py.conversions._image_arrays import COLOR_LAYER, Order
from grid_map_core_py.limits import check_cells

from ..errors import MessageError
from ._fields import check_fields, from_stamp, to_header
from ._packages import messages_of, set_array

if TYPE_CHECKING:
    from sensor_msgs.msg import Image
    from std_msgs.msg import Header


class Encoding(NamedTuple):
    dtype: np.dtype[Any]
    channels: int
    order: Order = "bgr"


_COLORS: dict[str, tuple[int, Order]] = {
    "mono": (1, "bgr"),
    "rgb": (3, "rgb"),
    "bgr": (3, "bgr"),
    "rgba": (4, "rgb"),
    "bgra": (4, "bgr"),
}
_TYPES = {"8U": "<u1", "16U": "<u2", "32F": "<f4", "64F": "<f8"}

ENCODINGS = {
    f"{name}{bits}": Encoding(np.dtype(f"<u{bits // 8}"), *color)
    for bits in (8, 16)
    for name, color in _COLORS.items()
} | {
    f"{name}C{channels}": Encoding(np.dtype(code), channels)
    for name, code in _TYPES.items()
    for channels in (1, 3, 4)
}
"""Supported encodings by their names in `sensor_msgs/Image`."""


# --- from layers to images ------------------------------------------------------------------------


def to_image(
    grid_map: GridMap,
    layer: str,
    encoding: str,
    lower: float | None = None,
    upper: float | None = None,
) -> "Image":
    """Convert a layer to an image with gray values.

    Args:
        grid_map, layer, lower, upper: as in `grid_map_core_py.to_image`.
        encoding: any name in `ENCODINGS`. In encodings with colors, all color channels contain the
            gray value. In encodings with alpha, alpha is 0 where the layer is NaN.
    """
    kind = _encoding_of(encoding)
    image = pixels.to_image(grid_map, layer, kind.dtype, kind.channels, lower, upper)
    return from_pixels(image, encoding, to_header(grid_map))


def to_color_image(grid_map: GridMap, layer: str = COLOR_LAYER, encoding: str = "rgb8") -> "Image":
    """Convert a layer of packed colors to a color image.

    Args:
        layer: layer of packed colors (see `color_vector_to_value`).
        encoding: name in `ENCODINGS` with three or four channels. In encodings with alpha, alpha is
            0 where the layer is NaN.
    """
    kind = _encoding_of(encoding)
    if kind.channels < 3:
        raise MessageError("encoding", "one with colors, such as 'rgb8'", encoding)
    image = pixels.to_color_image(grid_map, layer, kind.dtype, kind.channels, order=kind.order)
    return from_pixels(image, encoding, to_header(grid_map))


# --- from images to layers ------------------------------------------------------------------------


def from_image(
    message: "Image",
    layer: str,
    resolution: float,
    lower: float = 0.0,
    upper: float = 1.0,
    *,
    position: npt.ArrayLike = (0.0, 0.0),
    alpha_threshold: float = 0.5,
) -> GridMap:
    """Create a map with one layer from the gray values of an image.

    The map has the frame and the timestamp of the message. See `grid_map_core_py.from_image` for
    the other arguments.
    """
    image, order = to_pixels(message)
    return pixels.from_image(
        image,
        layer,
        resolution,
        lower,
        upper,
        position=position,
        alpha_threshold=alpha_threshold,
        order=order,
        frame_id=message.header.frame_id,
        timestamp=from_stamp(message.header.stamp),
    )


def add_layer_from_image(
    grid_map: GridMap,
    message: "Image",
    layer: str,
    lower: float = 0.0,
    upper: float = 1.0,
    *,
    alpha_threshold: float = 0.5,
) -> None:
    """Set a layer of a map to the gray values of an image.

    The image must have as many rows and columns as the map. See `from_image` for the arguments.
    """
    image, order = to_pixels(message, grid_map.size)
    pixels.add_layer_from_image(
        grid_map, image, layer, lower, upper, alpha_threshold=alpha_threshold, order=order
    )


def add_color_layer_from_image(
    grid_map: GridMap, message: "Image", layer: str = COLOR_LAYER, *, alpha_threshold: float = 0.5
) -> None:
    """Set a layer of a map to the packed colors of an image.

    In gray images, red, green and blue are equal. See `add_layer_from_image` for the arguments.
    """
    image, order = to_pixels(message, grid_map.size)
    pixels.add_color_layer_from_image(
        grid_map, image, layer, alpha_threshold=alpha_threshold, order=order
    )


# --- pixels in messages ---------------------------------------------------------------------------


def _encoding_of(name: str) -> Encoding:
    if name not in ENCODINGS:
        raise MessageError("encoding", f"one of {', '.join(ENCODINGS)}", name)
    return ENCODINGS[name]


def to_pixels(message: "Image", size: Size | None = None) -> tuple[npt.NDArray[Any], Order]:
    """Return the pixels (rows, cols, channels) of an image, and their color order.

    The pixels keep the byte order of the message. `size` is the required size (rows, cols).
    """
    check_fields(message, "sensor_msgs/Image", "encoding", "step")
    kind = _encoding_of(message.encoding)
    for name in ("height", "width"):
        if getattr(message, name) < 1:
            raise MessageError(name, "at least one pixel", getattr(message, name))
    pixel = kind.dtype.itemsize * kind.channels
    smallest = message.width * pixel
    if message.step < smallest:
        expected = f"at least {smallest} bytes ({message.width} pixels of {message.encoding})"
        raise MessageError("step", expected, message.step)
    if len(message.data) != message.step * message.height:
        expected = f"{message.step * message.height} bytes ({message.height} rows of "
        raise MessageError("data", f"{expected}{message.step})", len(message.data))
    if size not in (None, (message.height, message.width)):
        expected = f"{size}, as many as the map has rows and columns"
        raise MessageError("height, width", expected, (message.height, message.width))
    check_cells("image", (message.height, message.width))
    image: npt.NDArray[Any] = np.ndarray(
        (message.height, message.width, kind.channels),
        kind.dtype.newbyteorder(">" if message.is_bigendian else "<"),
        message.data,
        strides=(message.step, pixel, kind.dtype.itemsize),
    )
    return np.require(image, requirements="A"), kind.order


def from_pixels(pixels: npt.NDArray[Any], encoding: str, header: "Header") -> "Image":
    """Create an image from pixels (rows, cols[, channels]) with the dtype of the encoding."""
    data = array.array("B")
    little_endian = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder("<"))
    data.frombytes(little_endian.data.cast("B"))
    rows, columns = pixels.shape[:2]
    message = messages_of("sensor_msgs").Image(
        header=header,
        height=rows,
        width=columns,
        encoding=encoding,
        is_bigendian=0,
        step=len(data) // rows,
    )
    set_array(message, data)
    return message
