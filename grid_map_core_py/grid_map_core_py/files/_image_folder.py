# SPDX-License-Identifier: BSD-3-Clause
"""Maps as folders of PNG images, one per layer, with a YAML file.

The YAML file is one of nav2's `map_server`, too: it shows the first layer as occupancies, the
smallest value free, the largest occupied, NaN unknown. As there, up in the images is +y and right
is +x, which differs from the images of `grid_map_core_py.to_image`.

Losses: a value comes back less than one step below, at most one step of (`upper` - `lower`) /
65535 with 16 bits, / 255 with 8, and infinities become the bounds. NaN comes back as NaN: an image
with NaN has an alpha channel. Colors are kept; bits outside of the color are not. `save_npz`
loses nothing.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from .._arrays._checks import Layer, select_layers
from .._arrays._statistics import max_of_finites, min_of_finites
from ..conversions._image_arrays import (
    COLOR_LAYER,
    add_color_layer_from_image,
    add_layer_from_image,
    to_color_image,
    to_image,
)
from ..errors import GridMapError, short
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._atomic import new_folder
from ._image_files import encode_image, from_north_up, read_image, to_north_up
from ._shared import StoredMap, check_ending, storage_errors
from ._yaml import load_yaml

YAML_NAME = "map.yaml"
VERSION = 1

_DTYPES = {8: np.uint8, 16: np.uint16}


def save_images(
    grid_map: GridMap,
    folder: str | PathLike[str],
    layers: Iterable[str] | None = None,
    *,
    bits: int = 16,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    color_layers: Iterable[str] = (COLOR_LAYER,),
) -> Path:
    """Write layers as images, and the rest of the map as YAML.

    The folder is written atomically. An older folder of this format is replaced; anything
    else is not.

    Args:
        grid_map: the map; it may have moved, which the images do not show.
        folder: path of the new folder, or of `map.yaml` in it; its parent must exist.
        layers: names of the layers; None means all. The first one is what `map_server` shows.
        bits: 16 or 8, per pixel.
        ranges: `lower` and `upper` by layer, the values of black and white, beyond which values are
            clamped; for other layers the smallest and the largest finite value.
        color_layers: layers of packed colors, which become color images.

    Returns:
        The path of the YAML file.

    Raises:
        LayerNotFoundError: the map lacks a layer.
        GeometryError: a range is invalid.
        GridMapError: there are no layers, `bits` is neither, or the folder cannot be written.
    """
    if bits not in _DTYPES:
        raise GridMapError(f"bits: expected 8 or 16, got {short(bits)}")
    names = select_layers(grid_map, layers)
    if not names:
        raise GridMapError(f"{folder}: cannot be written: there are no layers")
    colors, given = {*color_layers}, ranges or {}
    for name in given:
        grid_map[name]  # An unknown name raises here.
    entries: list[dict[str, Any]] = []
    images = []
    for name, file in zip(names, _file_names(names), strict=True):
        has_holes = bool(np.isnan(grid_map[name]).any())
        if name in colors:
            mode: dict[str, Any] = {"mode": "color"}
            image = to_color_image(grid_map, name, np.uint8, 4 if has_holes else 3)
        else:
            lower, upper = map(float, given.get(name) or _range(grid_map, name))
            mode = {"mode": "values", "lower": lower, "upper": upper}
            image = to_image(grid_map, name, _DTYPES[bits], 4 if has_holes else 1, lower, upper)
        entries.append({"name": name, "image": file, **mode})
        images.append(to_north_up(image))
    target = Path(folder)
    target = target.parent if target.name == YAML_NAME else target
    check_ending(target)
    with storage_errors(target, "written"), new_folder(target, _check_old) as temporary:
        for entry, image in zip(entries, images, strict=True):
            (temporary / entry["image"]).write_bytes(encode_image(image, ".png"))
        (temporary / YAML_NAME).write_text(_document(grid_map, entries), encoding="utf-8")
    return target / YAML_NAME


def load_images(path: str | PathLike[str], layers: Iterable[str] | None = None) -> GridMap:
    """Return the map that `save_images` has written.

    Args:
        path: the folder, or the YAML file in it.
        layers: names of the layers to read; None means all.

    Raises:
        LayerNotFoundError: the file lacks a layer.
        GridMapError: a file is missing, damaged or of another format.
    """
    return _opened(path).load(layers)


def describe_images(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the facts about the map of a folder without reading an image."""
    return {"map": _opened(path).facts()}


def _opened(path: str | PathLike[str]) -> StoredMap:
    given = Path(path)
    file = given if given.suffix == ".yaml" and not given.is_dir() else given / YAML_NAME
    document = load_yaml(file)
    with storage_errors(file, "read"):
        found = part_of_maps(document)
        if found is None:
            raise ValueError("no file of a map: 'grid_map' is missing")
        if found.get("version") != VERSION:
            raise ValueError(f"version {found.get('version')!r}, only {VERSION} is known")
        rows, columns = found["size"]
        geometry = GridGeometry.from_size(
            (rows, columns), document["resolution"], found["position"]
        )
        empty = GridMap.from_geometry(
            geometry, frame_id=found["frame_id"], timestamp=found["timestamp"]
        )
        entries = {entry["name"]: entry for entry in found["layers"]}
        images = {name: file.parent / Path(entry["image"]).name for name, entry in entries.items()}
        for name in found["basic_layers"]:
            if name not in entries:
                raise ValueError(f"basic layer {name!r} is not among the layers")

        def read(name: str) -> Layer:
            entry, grid_map = entries[name], empty.copy()
            with storage_errors(images[name], "read"):
                pixels = from_north_up(read_image(images[name], empty.size[::-1]))
                mode = entry["mode"]
                if mode == "color":
                    add_color_layer_from_image(grid_map, pixels, name)
                elif mode == "values":
                    add_layer_from_image(grid_map, pixels, name, entry["lower"], entry["upper"])
                else:
                    raise ValueError(f"mode: expected 'values' or 'color', got {short(mode)}")
            return grid_map[name]

        packed = sum(image.stat().st_size for image in {*images.values()} if image.is_file())
        return StoredMap(empty, [*entries], found["basic_layers"], partial(map, read), file, packed)


def _range(grid_map: GridMap, layer: str) -> tuple[float, float]:
    """Return the range of the finite values; a range of nonzero width if all are equal."""
    low = np.float32(min_of_finites(grid_map[layer]))
    high = np.float32(max_of_finites(grid_map[layer]))
    if np.isnan(low):
        return 0.0, 1.0
    if low == high:
        high = low + np.float32(1) if abs(low) < 1e6 else np.nextafter(low, np.float32(0))
    return float(low), float(high)


def _document(grid_map: GridMap, entries: list[dict[str, Any]]) -> str:
    stored = {entry["name"] for entry in entries}
    origin = (grid_map.position - 0.5 * grid_map.length).tolist()
    document = {
        # The keys that map_server reads.
        "image": entries[0]["image"],
        "mode": "scale",
        "resolution": grid_map.resolution,
        "origin": [*origin, 0.0],
        "negate": 1,
        "occupied_thresh": 1.0,
        "free_thresh": 0.0,
        "grid_map": {
            "version": VERSION,
            "size": list(grid_map.size),
            "position": grid_map.position.tolist(),
            "frame_id": grid_map.frame_id,
            "timestamp": grid_map.timestamp,
            "basic_layers": [name for name in grid_map.basic_layers if name in stored],
            "layers": entries,
        },
    }
    return yaml.safe_dump(document, sort_keys=False)


def _file_names(names: Iterable[str]) -> Iterator[str]:
    """Yield a unique file name per layer that is valid on all file systems."""
    taken: set[str] = set()
    for name in names:
        stem = re.sub(r"[^A-Za-z0-9_-]+", "_", name)[:80] or "layer"
        number = 1
        while (file := stem if number == 1 else f"{stem}_{number}").lower() in taken:
            number += 1
        taken.add(file.lower())
        yield f"{file}.png"


def _check_old(folder: Path) -> None:
    """Raise unless a folder is empty or holds only files that `save_images` has written."""
    if not folder.is_dir():
        raise ValueError("it is a file, and the images go to a folder")
    file = folder / YAML_NAME
    found = part_of_maps(load_yaml(file)) if file.is_file() else None
    ours = {file.name, *(entry["image"] for entry in found["layers"])} if found else set()
    foreign = {path.name for path in folder.iterdir()} - ours
    if foreign:
        raise ValueError(f"it holds {min(foreign)}, which is no part of a saved map")


def part_of_maps(document: Any) -> Mapping[str, Any] | None:
    """Return the part of a YAML file that `map_server` ignores, None if there is none."""
    found = document.get("grid_map") if isinstance(document, dict) else None
    return found if isinstance(found, dict) else None
