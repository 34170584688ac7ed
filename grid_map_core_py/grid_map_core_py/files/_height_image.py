# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Height maps: one layer as a gray PNG image of 8 or 16 bits, or as a TIFF image of float32.

The file holds only pixels: the caller gives the size of a pixel and the heights of black and
of white. Up in the image is +y and right is +x.
"""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..conversions._image_arrays import from_image, to_image
from ..errors import GridMapError, LayerNotFoundError
from ..map._grid_map import GridMap
from ..map._layer_names import select_layers
from ._image_files import from_north_up, read_image, to_north_up, write_image
from ._npz import storage_errors

_TYPES = {8: np.uint8, 16: np.uint16, 32: np.float32}


def load_height_image(
    path: str | PathLike[str],
    layers: Iterable[str] | None = None,
    *,
    resolution: float | None = None,
    lower: float = 0.0,
    upper: float = 1.0,
    height_layer: str = "elevation",
    position: npt.ArrayLike = (0.0, 0.0),
    frame_id: str = "map",
) -> GridMap:
    """Return a map with one layer that holds the heights in an image.

    Pixels that are transparent by more than half are NaN, and so is NaN in an image of floats.
    Colors count as gray by their luma.

    Args:
        path: a PNG, TIFF, BMP or PGM file of uint8, uint16, float32 or float64.
        layers: None, or the name of the only layer.
        resolution: side of a pixel [m]; required.
        lower, upper: heights of black and of white [m]. An image of floats holds the heights
            themselves and takes neither.
        height_layer: name of the layer.
        position: (2,) center of the map [m].
        frame_id: frame of the map.

    Raises:
        LayerNotFoundError: `layers` asks for another layer.
        GridMapError: the file cannot be read or is no image, `resolution` is missing, or a bound
            is invalid.
    """
    file = Path(path)
    with storage_errors(file, "read"):
        pixels = read_image(file)
    if resolution is None:
        height, width = pixels.shape[:2]
        raise GridMapError(
            f"{path}: resolution: expected the side of a pixel [m], got nothing; "
            f"the image has {width} x {height} pixels"
        )
    if pixels.dtype.kind == "f" and (lower, upper) != (0.0, 1.0):
        raise GridMapError(
            f"{path}: lower and upper: expected none, got {lower} and {upper}; "
            "an image of floats holds the heights themselves"
        )
    grid_map = from_image(
        from_north_up(pixels),
        *(height_layer, resolution, lower, upper),
        position=position,
        frame_id=frame_id,
    )
    select_layers(grid_map, layers)  # raises if it asks for another one
    return grid_map


def save_height_image(
    grid_map: GridMap,
    path: str | PathLike[str],
    *,
    layer: str | None = None,
    bits: int | None = None,
    lower: float | None = None,
    upper: float | None = None,
) -> None:
    """Write one layer as a height image.

    The file is written atomically; an existing one is replaced. NaN becomes transparent,
    and stays NaN in an image of float32.

    Args:
        grid_map: the map; a moved one is stored in map order.
        path: the file; its name ends in .png, .tif or .tiff.
        layer: the layer; None means the only one, or `elevation`.
        bits: 8 or 16; 32 writes float32, for TIFF only. None means 16 for PNG and 32 for TIFF.
        lower, upper: heights of black and of white [m]; None means the smallest and the largest
            finite value. An image of float32 holds the heights themselves and takes neither.

    Raises:
        LayerNotFoundError: the map lacks the layer.
        GridMapError: an option is invalid, or the file cannot be written.
    """
    file = Path(path)
    ending = file.suffix.lower()
    if bits is None:
        bits = 16 if ending == ".png" else 32
    allowed = (8, 16) if ending == ".png" else (8, 16, 32)
    if bits not in allowed:
        expected = ", ".join(map(str, allowed))
        raise GridMapError(f"{path}: bits: expected one of {expected}, got {bits!r}")
    if bits == 32 and (lower, upper) != (None, None):
        raise GridMapError(
            f"{path}: lower and upper: expected none, got {lower} and {upper}; "
            "an image of float32 holds the heights themselves"
        )
    name = chosen_layer(grid_map, layer, "elevation")
    has_holes = bits != 32 and bool(np.isnan(grid_map[name]).any())
    image = to_image(grid_map, name, _TYPES[bits], 4 if has_holes else 1, lower, upper)
    with storage_errors(file, "written"):
        write_image(file, to_north_up(image))


def chosen_layer(grid_map: GridMap, layer: str | None, usual: str) -> str:
    """Return the layer that is asked for, else the one with the usual name, else the only one."""
    if layer is None and usual not in grid_map and len(grid_map.layers) == 1:
        return grid_map.layers[0]
    name = usual if layer is None else layer
    if name not in grid_map:
        raise LayerNotFoundError(name, grid_map.layers)
    return name
