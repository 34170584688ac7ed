# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Files of OctoMap, binary (.bt) or full (.ot).

Some lines of text come first, then the tree in the very bytes that messages hold:

    # Octomap OcTree binary file
    # comments
    id OcTree
    size 1234
    res 0.05
    data
"""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError, LayerNotFoundError

from ._octomap import ANYWHERE, from_octomap

BINARY, FULL = b"# Octomap OcTree binary file", b"# Octomap OcTree file"
"""First lines."""


def load_octomap(
    path: str | PathLike[str],
    layers: Iterable[str] | None = None,
    *,
    height_layer: str = "elevation",
    resolution: float | None = None,
    min_bound: npt.ArrayLike = ANYWHERE,
    max_bound: npt.ArrayLike = ANYWHERE,
    frame_id: str = "map",
) -> GridMap:
    """Return a map with the height of the highest occupied voxel of every column.

    Neither OctoMap nor `octomap_msgs` is needed.

    Args:
        path: a `.bt` or `.ot` file.
        layers: None, or the name of the layer: for readers that ask for layers.
        height_layer: name of the layer.
        resolution, min_bound, max_bound: as in `from_octomap`.
        frame_id: frame of the map.

    Raises:
        LayerNotFoundError: `layers` asks for another layer.
        GridMapError: the file cannot be read, is no octomap, or as in `from_octomap`.
    """
    octomap = _read(Path(path), frame_id)
    for name in [layers] if isinstance(layers, str) else layers or ():
        if name != height_layer:
            raise LayerNotFoundError(name, [height_layer])
    bounds: dict[str, Any] = {"min_bound": min_bound, "max_bound": max_bound}
    try:
        return from_octomap(octomap, height_layer, resolution, **bounds)
    except GridMapError as error:
        raise GridMapError(f"{path}: {error}") from error


def _read(path: Path, frame_id: str) -> Any:
    """Return an object with the fields of `octomap_msgs/Octomap`; the tree is not looked at."""
    try:
        head, separator, tree = path.read_bytes().partition(b"\ndata\n")
    except OSError as error:
        raise GridMapError(f"{path}: cannot be read: {error.strerror}") from error
    kind, *lines = head.splitlines() or [b""]
    if not (separator and kind in (BINARY, FULL)):
        raise GridMapError(f"{path}: cannot be read: expected a .bt or .ot file of OctoMap")
    entries = dict(line.partition(b" ")[::2] for line in lines if not line.startswith(b"#"))
    try:
        name, resolution = entries[b"id"].decode(), float(entries[b"res"])
    except (KeyError, ValueError) as error:
        raise GridMapError(f"{path}: cannot be read: its head lacks 'id' or 'res'") from error
    header = SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0), frame_id=frame_id)
    return SimpleNamespace(
        header=header, binary=kind == BINARY, id=name, resolution=resolution, data=tree
    )
