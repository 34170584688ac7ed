# SPDX-License-Identifier: BSD-3-Clause
"""Occupancy maps of Nav2's `map_server`: a YAML file, and an image in the same folder.

The YAML file selects one of three modes that convert pixels to occupancy, from 0 (free) to 100
(occupied). Let `shade` be the mean of the color channels, from 0 (black) to 1 (white). Let `occ` be
`1 - shade`, or `shade` if `negate` is set. In each mode, the occupancy is:

- `trinary`: 100 if `occ` is above `occupied_thresh`, 0 if `occ` is below `free_thresh`, otherwise
  unknown. An alpha channel counts as a fourth color channel.
- `scale`: as `trinary`, but the occupancy rises linearly from 0 to 100 between the two thresholds.
  It is computed in float32 and rounded (ties up), as in Nav2. Pixels that are not opaque are
  unknown.
- `raw`: the 8-bit pixel value if it is at most 100, otherwise unknown. `negate` has no effect.

Unknown cells are NaN in the map. Source: documentation and behavior of `nav2_map_server` in ROS 2
Jazzy.
"""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import yaml

from .._arrays._checks import Layer, select_layers
from .._arrays._pieces import PIECE, slices
from .._parameters import build, check
from ..conversions._image_arrays import Image
from ..errors import GridMapError, short
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._image_files import chosen_layer, from_north_up, read_image, to_north_up, write_image
from ._shared import check_ending, load_yaml, new_file, say_crs_is_lost, storage_errors

Mode: TypeAlias = Literal["trinary", "scale", "raw"]

MODES = ("trinary", "scale", "raw")
LAYER = "occupancy"

_THRESHOLDS = {"trinary": (0.65, 0.196), "scale": (1.0, 0.0), "raw": (0.65, 0.196)}
"""Default thresholds (occupied, free) by mode; with them, loading restores the saved values."""

_BLACK, _UNKNOWN, _WHITE = 0, 205, 254
"""Pixel values that nav2's `map_saver` writes in `trinary` mode: occupied, unknown and free."""


def load_map_server(
    path: str | PathLike[str],
    layers: Iterable[str] | None = None,
    *,
    occupancy_layer: str = LAYER,
    frame_id: str = "map",
) -> GridMap:
    """Load an occupancy map in the format of Nav2's `map_server`.

    Args:
        path: the YAML file, or a folder that contains `map.yaml`.
        layers: names of the layers to load; only `occupancy_layer` exists. None means all.
        occupancy_layer: name of the layer; values are 0 (free) to 100 (occupied), or NaN (unknown).
        frame_id: frame of the map.

    Raises:
        LayerNotFoundError: `layers` contains a name other than `occupancy_layer`.
        GridMapError: a file is missing or damaged, a key of the YAML file is missing or invalid, or
            the map is rotated (the yaw in `origin` is not 0).
    """
    file = Path(path)
    file = file / "map.yaml" if file.is_dir() else file
    document = load_yaml(file)
    with storage_errors(file, "read"):
        settings = _settings(document)
    image = file.parent / settings.image
    with storage_errors(image, "read"):
        pixels = read_image(image)
        # A few rows at a time, because temporary arrays are many times as large as the pixels.
        parts = slices(len(pixels), PIECE // pixels.shape[1])
        values = np.concatenate([_occupancy(pixels[part], settings) for part in parts])
    occupancy = from_north_up(values)
    with storage_errors(file, "read"):
        rows, columns = occupancy.shape
        position = settings.origin[:2] + 0.5 * settings.resolution * np.array((rows, columns))
        geometry = GridGeometry.from_size((rows, columns), settings.resolution, position)
        layer = {occupancy_layer: occupancy}
        grid_map = GridMap.from_geometry(geometry, layer, frame_id=frame_id)
    select_layers(grid_map, layers)  # raises if a layer is missing
    return grid_map


def save_map_server(
    grid_map: GridMap,
    path: str | PathLike[str],
    *,
    layer: str | None = None,
    mode: Mode = "trinary",
    negate: bool = False,
    occupied_thresh: float | None = None,
    free_thresh: float | None = None,
    data_min: float | None = None,
    data_max: float | None = None,
) -> None:
    """Write a layer as an occupancy map in the format of Nav2's `map_server`.

    The image is written to the folder of the YAML file. The image format is PNG with alpha in
    `scale` mode, and PGM in the other modes. An existing map stays intact until the new YAML file
    replaces the old one.

    Args:
        grid_map: the map; it is stored in map order.
        path: the YAML file.
        layer: name of the layer; None means `occupancy` if it exists, else the only layer. Without
            `data_min` and `data_max`, the values must be whole numbers from 0 (free) to 100
            (occupied), or NaN or -1 (unknown).
        mode: `trinary` distinguishes only occupied, free and unknown cells; `scale` and `raw` keep
            the occupancy values.
        negate: if True, white means occupied. This has no effect in `raw` mode.
        occupied_thresh, free_thresh: thresholds for occupied and free cells, 0 to 1. None means
            0.65 and 0.196, or 1 and 0 in `scale` mode. If the thresholds are at least 0.4 apart,
            loading a `scale` map restores all occupancy values exactly.
        data_min, data_max: layer values that become occupancy 0 and 100; `data_max` may be less
            than `data_min`. Values in between are scaled linearly and rounded to whole numbers, and
            other values are clamped. If these arguments are given, only NaN means unknown.

    Raises:
        GridMapError: an option is invalid, a file cannot be written, or a value is not a valid
            occupancy.
    """
    file = Path(path)
    check_ending(file, ".yaml", ".yml")
    if mode not in MODES:
        raise GridMapError(f"mode: expected one of {', '.join(MODES)}, got {short(mode)}")
    usual_occupied, usual_free = _THRESHOLDS[mode]
    occupied = usual_occupied if occupied_thresh is None else float(occupied_thresh)
    free = usual_free if free_thresh is None else float(free_thresh)
    if not 0 <= free < occupied <= 1:
        raise GridMapError(
            "free_thresh, occupied_thresh: expected 0 <= free < occupied <= 1, "
            f"got {free} and {occupied}"
        )
    say_crs_is_lost(grid_map, "an image")
    name = chosen_layer(grid_map, layer, LAYER)
    values = _as_occupancies(to_north_up(grid_map.unwrapped(name)), name, data_min, data_max)
    image = _pixels(values, mode, occupied, free, negate=negate)
    with storage_errors(file, "written"):
        old = _old_image(file)
        ending = ".png" if mode == "scale" else ".pgm"
        target, number = file.with_suffix(ending), 1
        while target.exists():
            number += 1
            target = file.with_name(f"{file.stem}_{number}{ending}")
        document = {
            "image": target.name,
            "mode": mode,
            "resolution": grid_map.resolution,
            "origin": [*(grid_map.position - 0.5 * grid_map.length).tolist(), 0.0],
            "negate": int(negate),
            "occupied_thresh": occupied,
            "free_thresh": free,
        }
        write_image(target, image)
        with new_file(file) as temporary:
            temporary.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
        if old is not None:
            old.unlink(missing_ok=True)


@dataclass(frozen=True, kw_only=True)
class _Settings:
    image: str
    resolution: float
    origin: tuple[float, ...]
    occupied_thresh: float
    free_thresh: float
    mode: Mode = "trinary"
    negate: Literal[0, 1] = 0

    def __post_init__(self) -> None:
        check(self.image != "", "image", "the name of a file", self.image)
        for name in ("resolution", "occupied_thresh", "free_thresh"):
            value = getattr(self, name)
            check(math.isfinite(value), name, "a finite number", value)
        numbers = len(self.origin) == 3 and all(map(math.isfinite, self.origin))
        check(numbers, "origin", "[x, y, yaw]", self.origin)
        expected = "a yaw of 0 (a grid map is never rotated, so rotate the image)"
        check(self.origin[2] == 0, "origin", expected, self.origin[2])


def _settings(document: Any) -> _Settings:
    if not isinstance(document, Mapping):
        raise ValueError("expected keys and values such as 'image: map.pgm'")
    if "image" not in document:
        text = "expected a map of nav2's map_server, with the key 'image'"
        raise ValueError(f"{text}. A filter chain runs with `grid-map filter`")
    known = {field.name for field in fields(_Settings)}
    return build(_Settings, {key: value for key, value in document.items() if key in known})


def _occupancy(pixels: Image, settings: _Settings) -> Layer:
    """Convert the pixels of an image to occupancy values (rows, cols): 0 to 100, or NaN."""
    if pixels.dtype.kind != "u":
        raise ValueError(f"expected an image of 8 or 16 bits, got {pixels.dtype}")
    largest = np.iinfo(pixels.dtype).max
    channels = pixels.reshape(*pixels.shape[:2], -1)
    alpha = channels[..., 3] if channels.shape[2] == 4 else None
    colors = channels if alpha is not None and settings.mode == "trinary" else channels[..., :3]
    number = np.float32 if settings.mode == "scale" else np.float64
    shade = colors.mean(axis=2, dtype=number) / number(largest)
    if settings.mode == "raw":
        values = np.floor(shade * 255 + 0.5)
        return np.where(values <= 100, values, np.nan).astype(np.float32)
    occupied, free = number(settings.occupied_thresh), number(settings.free_thresh)
    occ = shade if settings.negate else number(1) - shade
    if settings.mode == "scale" and occupied != free:
        extent = number(settings.occupied_thresh - settings.free_thresh)
        # In float32, adding 0.5 to a value just below a tie would round it up.
        between = np.floor(((occ - free) / extent * number(100)).astype(np.float64) + 0.5)
    else:
        between = np.full(occ.shape, np.nan)
    values = np.where(occ > occupied, 100.0, np.where(occ < free, 0.0, between))
    if settings.mode == "scale" and alpha is not None:
        values[alpha < largest] = np.nan
    return values.astype(np.float32)


def _as_occupancies(
    values: Layer, name: str, data_min: float | None, data_max: float | None
) -> Layer:
    """Return occupancy values from 0 to 100, or NaN; see `save_map_server`."""
    if data_min is None and data_max is None:
        known = (values >= 0) & (values <= 100) & (values == np.rint(values))
        wrong = ~(known | (values == -1) | np.isnan(values))
        if wrong.any():
            raise GridMapError(
                f"layer {name!r}: expected occupancies (whole numbers from 0 to 100, -1 or NaN), "
                f"got {values[wrong][0]:g}. Pass the values of free and of occupied cells as "
                "data_min and data_max, such as data_min=1.0, data_max=0.0 for traversability"
            )
        return np.where(known, values, np.float32(np.nan))
    low, high = (math.nan if bound is None else float(bound) for bound in (data_min, data_max))
    if not math.isfinite(high - low) or low == high:
        expected = "two different finite numbers"
        raise GridMapError(f"data_min, data_max: expected {expected}, got {data_min}, {data_max}")
    occupancies = (values.astype(np.float64) - low) * (100 / (high - low))
    return np.clip(occupancies, 0, 100).astype(np.float32)


def _pixels(values: Layer, mode: Mode, occupied: float, free: float, *, negate: bool) -> Image:
    """Convert occupancy values to image pixels, which `_occupancy` can convert back."""
    known = ~np.isnan(values)
    rounded = np.where(known, np.rint(values.astype(np.float64)), 0.0)
    if mode == "raw":
        return np.where(known, rounded, 255).astype(np.uint8)
    if mode == "scale":
        shade = 1.0 - (free + rounded / 100.0 * (occupied - free))
        gray = np.rint(255 * np.where(known, 1.0 - shade if negate else shade, 0.5))
        return np.dstack([gray, gray, gray, 255 * known]).astype(np.uint8)
    # The usual pixel value of unknown cells, 205, may not be between the thresholds.
    middle = round(255 * (1 - 0.5 * (occupied + free)))
    unknown = _UNKNOWN if free <= 1 - _UNKNOWN / 255 <= occupied else middle
    is_occupied, is_free = rounded >= round(100 * occupied), rounded <= round(100 * free)
    gray = np.where(is_free, _WHITE, np.where(is_occupied, _BLACK, unknown))
    gray = np.where(known, gray, unknown)
    return (255 - gray if negate else gray).astype(np.uint8)


def _old_image(file: Path) -> Path | None:
    """Return the image path of an existing map, or None if `save_map_server` did not write it."""
    if not file.exists():
        return None
    document = load_yaml(file)
    name = document.get("image") if isinstance(document, Mapping) else None
    if not isinstance(name, str):
        raise ValueError("the existing file is not a map of map_server")
    is_ours = re.fullmatch(rf"{re.escape(file.stem)}(_\d+)?\.(pgm|png)", name)
    return file.with_name(name) if is_ours else None
