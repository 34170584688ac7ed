# SPDX-License-Identifier: BSD-3-Clause
"""Convert layers to images and images to layers, and change the resolution of maps.

Pixel (0, 0) of an image is the map cell with the largest x and y. In the image, +x points up and +y
points left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from .._arrays._checks import Layer, Size, as_finite, as_number
from .._arrays._pieces import piece_of, slices
from .._arrays._statistics import max_of_finites, min_of_finites
from ..errors import GeometryError, short
from ..map import _ring_buffer as ring_buffer
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..map._interpolation import Interpolation
from ..map._resampling import resample, resize_flag
from ._packed_colors import color_channels_to_value, color_value_to_bytes

Image: TypeAlias = NDArray[Any]
"""(rows, cols) or (rows, cols, channels) uint8, uint16, float32 or float64; 1, 3 or 4 channels."""

Order: TypeAlias = Literal["bgr", "rgb"]

COLOR_LAYER = "color"
"""Conventional name of a packed-color layer."""

_LARGEST = {"uint8": 255, "uint16": 65535, "float32": 1, "float64": 1}
_TO_GRAY = {
    ("bgr", 3): cv2.COLOR_BGR2GRAY,
    ("bgr", 4): cv2.COLOR_BGRA2GRAY,
    ("rgb", 3): cv2.COLOR_RGB2GRAY,
    ("rgb", 4): cv2.COLOR_RGBA2GRAY,
}
_TIE = 1e-9  # tolerance [cells] for rounding halves away from zero


def to_image(
    grid_map: GridMap,
    layer: str,
    dtype: DTypeLike = np.uint8,
    channels: int = 1,
    lower: float | None = None,
    upper: float | None = None,
) -> Image:
    """Convert a layer to a gray image.

    Pixel (0, 0) is the map cell with the largest x and y. Values outside the bounds are clamped. If
    both bounds are None, a float image contains the layer values unchanged. NaN becomes 0 in
    integer images, and stays NaN in float images. With alpha, NaN cells are transparent.

    Args:
        dtype: uint8, uint16, float32 or float64.
        channels: 1, 3 (three equal channels) or 4 (three equal channels and alpha).
        lower: layer value mapped to black; by default, the smallest finite value.
        upper: layer value mapped to white (255, 65535 or 1.0); by default, the largest finite
            value. It may be less than `lower`.

    Returns:
        (rows, cols) for one channel, else (rows, cols, channels); C-contiguous.

    Raises:
        GeometryError: the type, the channels or the bounds are invalid.
    """
    pixel = _pixel_type(dtype, "dtype")
    _check(channels in (1, 3, 4), "channels", "1, 3 or 4", channels)
    gray = _encoder(grid_map[layer], pixel, lower, upper)
    return _paint(grid_map, layer, pixel, channels, lambda values: 3 * (gray(values),))


def to_color_image(
    grid_map: GridMap,
    layer: str,
    dtype: DTypeLike = np.uint8,
    channels: int = 3,
    *,
    order: Order = "bgr",
) -> Image:
    """Convert a layer of packed colors to a color image.

    NaN becomes 0 in integer images, and stays NaN in float images. With alpha, NaN cells are
    transparent.

    Args:
        layer: layer of packed colors, as returned by `color_vector_to_value`.
        dtype: uint8, uint16, float32 or float64.
        channels: 3, or 4 with alpha.
        order: order of the channels; "bgr" suits OpenCV.

    Returns:
        (rows, cols, channels), C-contiguous.

    Raises:
        GeometryError: the type, the number of channels or the order is invalid.
    """
    pixel = _pixel_type(dtype, "dtype")
    _check(channels in (3, 4), "channels", "3 or 4", channels)
    _check_order(order)

    def colors(values: Layer) -> list[NDArray[Any]]:
        missing, painted = np.isnan(values), []
        for color in color_value_to_bytes(values):
            channel = color.astype(pixel)
            if pixel.kind == "f":
                channel /= 255
            else:
                channel *= _LARGEST[pixel.name] // 255
            channel[missing] = np.nan if pixel.kind == "f" else 0
            painted.append(channel)
        return painted if order == "rgb" else painted[::-1]

    return _paint(grid_map, layer, pixel, channels, colors)


def _paint(
    grid_map: GridMap,
    layer: str,
    pixel: np.dtype[Any],
    channels: int,
    paint: Callable[[Layer], Sequence[NDArray[Any]]],
) -> Image:
    rows, columns = grid_map.size
    image = np.empty((rows, columns, channels), pixel)
    for part in slices(rows, piece_of(rows * columns) // columns):
        block = ring_buffer.block(grid_map[layer], grid_map.start_index, part, slice(0, columns))
        for channel, values in zip(range(channels), paint(block), strict=False):
            image[part, :, channel] = values
        if channels == 4:
            image[part, :, 3] = _LARGEST[pixel.name] * ~np.isnan(block)
    return image.reshape(rows, columns) if channels == 1 else image


def _encoder(
    values: Layer, pixel: np.dtype[Any], lower: float | None, upper: float | None
) -> Callable[[Layer], Layer]:
    """Return a function that scales layer values to the gray range of `pixel`, without a cast."""
    if pixel.kind == "f" and lower is None and upper is None:
        return lambda values: values
    low, high = _range(lower, upper, values)
    # `fmax` and `fmin` map NaN to the lower bound, which becomes 0.
    clamps = (np.maximum, np.minimum) if pixel.kind == "f" else (np.fmax, np.fmin)
    first, second = clamps if low <= high else clamps[::-1]
    extent = high - low if high != low else np.float32(1)

    def gray(values: Layer) -> Layer:
        # The operations are in the same order as in C++, so that results are bitwise equal.
        share: Layer = second(first(values, low), high)
        share -= low
        share /= extent
        share *= np.float32(_LARGEST[pixel.name])
        return share

    return gray


def _range(
    lower: float | None, upper: float | None, values: Layer
) -> tuple[np.float32, np.float32]:
    """Return float32 bounds; the smallest or largest finite value replaces None."""
    low = math.nan if lower is None else as_number(lower, "lower")
    high = math.nan if upper is None else as_number(upper, "upper")
    # If only one bound is given, and all finite values lie beyond it, both bounds are equal.
    if lower is None:
        low = float(np.fmin(min_of_finites(values), high))
    if upper is None:
        high = float(np.fmax(max_of_finites(values), low))
    if lower is None and upper is None and math.isnan(low):
        low = high = 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        first, last = np.float32(low), np.float32(high)
        is_flat = first == last and lower is not None and upper is not None
        sensible = np.isfinite(last - first) and not is_flat
    _check(sensible, "lower, upper", "two different finite float32 numbers", (low, high))
    return first, last


def from_image(
    image: ArrayLike,
    layer: str,
    resolution: float,
    lower: float = 0.0,
    upper: float = 1.0,
    *,
    position: ArrayLike = (0.0, 0.0),
    alpha_threshold: float = 0.5,
    order: Order = "bgr",
    frame_id: str = "",
    timestamp: int = 0,
) -> GridMap:
    """Create a map with one layer from the gray values of an image.

    Args:
        image: (rows, cols), or (rows, cols, channels) with 1, 3 or 4 channels; uint8, uint16,
            float32 or float64. OpenCV's `cvtColor` converts colors to gray values (ITU-R BT.601).
        resolution: side of a pixel [m].
        lower, upper: layer values for black (0) and white (255, 65535 or 1.0) pixels. With 0 and 1,
            the values of a float image are copied unchanged.
        position: (2,) center of the map [m].
        alpha_threshold: alpha below which pixels become NaN, from 0 to 1 (opaque). For integer
            images, the threshold is scaled to the range of the type and rounded down.
        order: order of the color channels; `cv2.imread` returns "bgr".
        timestamp: time of the data [ns].

    Raises:
        GeometryError: the image, the bounds, the order or the grid is invalid.
    """
    pixels = _as_image(image)
    values = _read_gray(pixels, lower, upper, alpha_threshold, order)
    rows, columns = values.shape
    geometry = GridGeometry.from_size((rows, columns), resolution, position)
    grid_map = GridMap.from_geometry(geometry, frame_id=frame_id, timestamp=timestamp)
    return grid_map.with_layers({layer: values})


def add_layer_from_image(
    grid_map: GridMap,
    image: ArrayLike,
    layer: str,
    lower: float = 0.0,
    upper: float = 1.0,
    *,
    alpha_threshold: float = 0.5,
    order: Order = "bgr",
) -> None:
    """Store the gray values of an image in a new or existing layer of a map.

    Args:
        grid_map: map with as many rows and columns as the image; it may have moved.
        image, layer, lower, upper, alpha_threshold, order: as in `from_image`.

    Raises:
        GeometryError: image and map differ in size, or one of the other arguments is invalid.
    """
    pixels = _as_image(image, grid_map.size)
    grid_map.set_unwrapped(layer, _read_gray(pixels, lower, upper, alpha_threshold, order))


def add_color_layer_from_image(
    grid_map: GridMap,
    image: ArrayLike,
    layer: str = COLOR_LAYER,
    *,
    alpha_threshold: float = 0.5,
    order: Order = "bgr",
) -> None:
    """Store the packed colors of an image in a new or existing layer of a map.

    Args:
        grid_map: map with as many rows and columns as the image; it may have moved.
        image: as in `from_image`; 255, 65535 and 1.0 are full intensity.
        alpha_threshold, order: as in `from_image`.

    Raises:
        GeometryError: image and map differ in size, or the image or the order is invalid.
    """
    _check_order(order)

    def values_of(part: Image) -> Layer:
        channels = part[..., :3] if order == "rgb" else part[..., 2::-1]
        if part.dtype == np.uint16:
            channels = (channels // 257).astype(np.uint8)
        red, green, blue = (channels[..., min(n, channels.shape[2] - 1)] for n in range(3))
        return color_channels_to_value(red, green, blue)

    pixels = _as_image(image, grid_map.size)
    grid_map.set_unwrapped(layer, _read(pixels, values_of, alpha_threshold))


def _read_gray(
    pixels: Image, lower: float, upper: float, alpha_threshold: float, order: Order
) -> Layer:
    _check_order(order)
    largest = np.float32(_LARGEST[pixels.dtype.name])
    low, high = _range(as_number(lower, "lower"), as_number(upper, "upper"), pixels)

    def values(part: Image) -> Layer:
        if part.dtype == np.float64:
            part = part.astype(np.float32)
        channels = part.shape[2]
        single = part[..., 0] if channels == 1 else cv2.cvtColor(part, _TO_GRAY[order, channels])
        gray: Layer = np.array(single, dtype=np.float32)
        gray /= largest
        gray *= high - low
        gray += low
        return gray

    return _read(pixels, values, alpha_threshold)


def _read(pixels: Image, values_of: Callable[[Image], Layer], alpha_threshold: float) -> Layer:
    """Convert pixels to a layer; transparent pixels become NaN."""
    rows, columns, channels = pixels.shape
    values: Layer = np.empty((rows, columns), np.float32, order="F")
    share = as_number(alpha_threshold, "alpha_threshold")
    _check(0 <= share <= 1, "alpha_threshold", "a number from 0 to 1", alpha_threshold)
    threshold = pixels.dtype.type(share * _LARGEST[pixels.dtype.name])
    # Values and sums outside the float32 range become infinite.
    with np.errstate(over="ignore", invalid="ignore"):
        for part in slices(rows, piece_of(rows * columns) // columns):
            block = np.ascontiguousarray(pixels[part])
            values[part] = values_of(block)
            if channels == 4:
                values[part][block[..., 3] < threshold] = np.nan
    return values


def change_resolution(
    grid_map: GridMap, resolution: float, interpolation: Interpolation | str | int = "cubic"
) -> GridMap:
    """Resample a map to another resolution.

    Layers are interpolated as float images with OpenCV's `resize`. If the nearest cell in the
    original map is NaN or infinite, the new cell gets that value. All other cells are interpolated
    from finite cells only. In the layer `color`, each cell gets the nearest color. If other layers
    contain packed colors, pass `cv2.INTER_NEAREST_EXACT`.

    Args:
        resolution: new side of a cell [m].
        interpolation: "nearest", "linear", "cubic", "area" or "lanczos"; an `Interpolation` with
            one of these names; or an interpolation flag of `cv2.resize`.

    Returns:
        A map with `size * old / new` cells, rounded to the nearest integers (halves up). The start
        index is (0, 0). Position, frame, time and basic layers stay unchanged.

    Raises:
        GeometryError: the resolution is not positive or results in no cells, or OpenCV does not
            support the interpolation.
    """
    target = as_finite(resolution, "resolution", "a positive number", above=0.0)
    factor = grid_map.resolution / target
    rows, columns = (int(cells * factor + 0.5 + _TIE) for cells in grid_map.size)
    expected = f"at most twice the length {tuple(grid_map.length.tolist())} of the map"
    _check(rows > 0 and columns > 0, "resolution", expected, resolution)
    geometry = GridGeometry.from_size((rows, columns), target, grid_map.position)
    flag = resize_flag(interpolation)
    layers = {
        name: resample(
            grid_map.unwrapped(name),
            geometry.size,
            factor,
            cv2.INTER_NEAREST_EXACT if name == COLOR_LAYER else flag,
        )
        for name in grid_map
    }
    return grid_map._with(layers, geometry, (0, 0))


def _as_image(image: ArrayLike, size: Size | None = None) -> Image:
    """Return an image as an array (rows, cols, channels), or raise `GeometryError`."""
    if image is None:
        raise GeometryError("image: got None, which cv2.imread returns for a file it cannot read")
    try:
        pixels = np.asarray(image)
    except ValueError as error:
        raise GeometryError(f"image: expected an array of pixels, got {short(image)}") from error
    pixels = pixels.astype(_pixel_type(pixels.dtype, "image"), copy=False)
    shape = pixels.shape if pixels.ndim != 2 else (*pixels.shape, 1)
    sensible = len(shape) == 3 and shape[2] in (1, 3, 4) and 0 not in shape
    _check(sensible, "image", "shape (rows, cols) or (rows, cols, 1, 3 or 4)", pixels.shape)
    expected = f"{size} pixels, as many as the map has cells"
    _check(size is None or shape[:2] == size, "image", expected, shape[:2])
    return pixels.reshape(shape)


def _pixel_type(dtype: DTypeLike, name: str) -> np.dtype[Any]:
    try:
        pixel = np.dtype(dtype).newbyteorder("=")
    except TypeError:
        pixel = np.dtype(object)
    _check(pixel.name in _LARGEST, name, f"one of {', '.join(_LARGEST)}", dtype)
    return pixel


def _check_order(order: str) -> None:
    _check(order in ("bgr", "rgb"), "order", "'bgr' or 'rgb'", order)


def _check(condition: bool | np.bool_, name: str, expected: str, found: object) -> None:
    if not condition:
        raise GeometryError(f"{name}: expected {expected}, got {short(found)}")
