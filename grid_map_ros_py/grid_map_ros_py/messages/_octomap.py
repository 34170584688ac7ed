# SPDX-License-Identifier: BSD-3-Clause
"""Create grid maps from `octomap_msgs/Octomap` messages and from OctoMap files."""

import math
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py._arrays import as_array
from grid_map_core_py._arrays._checks import select_layers
from grid_map_core_py.conversions import rasterize
from grid_map_core_py.conversions._point_layers import fitting_geometry
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files._shared import storage_errors
from grid_map_core_py.limits import check_bytes, check_cells
from grid_map_core_py.map._axis import BORDER_TOLERANCE

from ..errors import MessageError
from ._fields import check_fields, from_stamp
from ._octree import (
    NODE_TYPES,
    VOXELS,
    Leaves,
    Voxel,
    extent,
    highest_voxels,
    occupied_voxels,
    read_binary,
    read_full,
)

if TYPE_CHECKING:
    from octomap_msgs.msg import Octomap

SMALLEST_VOXEL, LARGEST_VOXEL = 1e-30, 1e30
"""Limits of the voxel size [m]; beyond them, float32 coordinates lose precision or overflow."""

Points = npt.NDArray[np.float64]

ANYWHERE = (math.nan, math.nan, math.nan)

BINARY, FULL = b"# Octomap OcTree binary file", b"# Octomap OcTree file"
"""First line of binary and of full OctoMap files."""


def from_octomap(
    message: "Octomap",
    layer: str = "elevation",
    resolution: float | None = None,
    *,
    min_bound: npt.ArrayLike = ANYWHERE,
    max_bound: npt.ArrayLike = ANYWHERE,
) -> GridMap:
    """Create an elevation map from the highest occupied voxels of an octree.

    The height of a voxel column is the z coordinate of the center of its highest occupied voxel.
    Only voxel centers within the bounds count. Columns without such a voxel are NaN. The map
    extends to the bounds. On sides without a bound, it extends to the edge of the tree, including
    free space.

    Args:
        message: an `octomap_msgs/Octomap`, or an object with the same fields. The tree is binary or
            full, and its class is OcTree, OcTreeStamped or ColorOcTree.
        resolution: cell size [m]; None means the voxel size. Larger cells get the maximum height of
            the columns whose centers they contain. Smaller cells are an error.
        min_bound, max_bound: (3,) smallest and largest x, y, z [m] of the voxel centers. Voxels
            beyond these bounds are ignored. NaN means no bound.
    """
    leaves = _leaves(message)
    timestamp = from_stamp(message.header.stamp)
    first, last = _box(leaves, message.resolution, min_bound, max_bound)
    rows, columns = (last - first + 1)[:2].tolist()
    check_cells("extent", (rows, columns))
    highest = highest_voxels(leaves, first, last)
    heights = _meters(highest.astype(np.float32), message.resolution)
    heights[highest < 0] = np.nan
    middle = _meters(0.5 * (first + last)[:2], message.resolution)
    # The first cell of a map has the largest x and y.
    grid_map = GridMap.from_geometry(
        GridGeometry.from_size((rows, columns), message.resolution, middle),
        {layer: heights[::-1, ::-1]},
        frame_id=message.header.frame_id,
        timestamp=timestamp,
    )
    if resolution is None or resolution == message.resolution:
        return grid_map
    if resolution < grid_map.resolution:
        expected = f"at least that of the tree, {grid_map.resolution}"
        raise MessageError("resolution", expected, resolution)
    half = 0.5 * grid_map.length
    geometry = fitting_geometry(
        grid_map.position - half, grid_map.position + half, resolution, hold_edges=False
    )
    points = np.column_stack([grid_map.get_positions(), grid_map[layer].ravel("F")])
    coarse = GridMap.from_geometry(geometry, frame_id=grid_map.frame_id, timestamp=timestamp)
    return rasterize(points, coarse, {layer: "max"})


def octomap_to_points(
    message: "Octomap", *, min_bound: npt.ArrayLike = ANYWHERE, max_bound: npt.ArrayLike = ANYWHERE
) -> Points:
    """Return the centers (N, 3) [m] of the occupied voxels; see `from_octomap` for the bounds."""
    leaves = _leaves(message)
    if not leaves:
        return np.empty((0, 3))
    first, last = _box(leaves, message.resolution, min_bound, max_bound)
    voxels = occupied_voxels(leaves, first, last).astype(np.float64)
    return np.ascontiguousarray(_meters(voxels, message.resolution).T)


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
    """Load an elevation map from an OctoMap file (`.bt` or `.ot`).

    Args:
        layers: names of the layers to load; None means all. The map has only `height_layer`.
        height_layer: name of the layer with the heights [m].
        resolution, min_bound, max_bound: as in `from_octomap`.
    """
    bounds: dict[str, Any] = {"min_bound": min_bound, "max_bound": max_bound}
    with storage_errors(Path(path), "read"):
        octomap = _read(Path(path), frame_id)
        select_layers([height_layer], layers)
        try:
            return from_octomap(octomap, height_layer, resolution, **bounds)
        except MessageError as error:
            raise GridMapError(f"{path}: {error}") from error


def _read(path: Path, frame_id: str) -> Any:
    check_bytes(f"{path}: file", path.stat().st_size, math.inf)
    head, separator, tree = path.read_bytes().partition(b"\ndata\n")
    kind, *lines = head.splitlines() or [b""]
    if not (separator and kind in (BINARY, FULL)):
        raise ValueError("expected a .bt or .ot file of OctoMap")
    entries = dict(line.partition(b" ")[::2] for line in lines if not line.startswith(b"#"))
    if not {b"id", b"res"} <= entries.keys():
        raise ValueError("its header lacks 'id' or 'res'")
    name, resolution = entries[b"id"].decode(), float(entries[b"res"])
    header = SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0), frame_id=frame_id)
    return SimpleNamespace(
        header=header, binary=kind == BINARY, id=name, resolution=resolution, data=tree
    )


def _leaves(message: "Octomap") -> Leaves:
    check_fields(message, "octomap_msgs/Octomap", "binary", "resolution")
    if not SMALLEST_VOXEL < message.resolution < LARGEST_VOXEL:
        raise MessageError("resolution", "the side of a voxel [m]", message.resolution)
    data = np.frombuffer(message.data, np.uint8)
    if message.binary:
        return read_binary(data)
    if message.id not in NODE_TYPES:
        raise MessageError("id", f"one of {', '.join(NODE_TYPES)}", message.id)
    return read_full(data, NODE_TYPES[message.id])


def _box(
    leaves: Leaves, resolution: float, min_bound: npt.ArrayLike, max_bound: npt.ArrayLike
) -> tuple[Voxel, Voxel]:
    """Return the first and last voxel (3,) within the bounds; NaN means the edge of the tree."""
    bounds = np.empty((2, 3))
    for row, name, bound in ((0, "min_bound", min_bound), (1, "max_bound", max_bound)):
        values = as_array(bound, np.float64, name)
        if values.shape != (3,):
            raise MessageError(name, "x, y and z", bound)
        bounds[row] = values
    tolerance = BORDER_TOLERANCE / resolution
    # The center of voxel k lies k + 1/2 voxels from the corner of the root.
    steps = np.clip(bounds / resolution, -VOXELS, VOXELS) + VOXELS // 2 - 0.5
    nearest = np.stack([np.ceil(steps[0] - tolerance), np.floor(steps[1] + tolerance)])
    missing = np.isnan(bounds)
    if missing.any():
        nearest = np.where(missing, np.stack(extent(leaves)), nearest)
    first, last = np.clip(nearest, 0, VOXELS - 1).astype(np.int32)
    within = (nearest[0] <= nearest[1]) & (nearest[0] < VOXELS) & (nearest[1] >= 0)
    if not within.all():
        found = tuple(map(tuple, bounds.tolist()))
        raise MessageError("min_bound, max_bound", "voxels between them", found)
    return first, last


def _meters(keys: npt.NDArray[Any], resolution: float) -> npt.NDArray[Any]:
    """Convert voxel keys to the coordinates of the voxel centers [m]."""
    return np.asarray((keys - (VOXELS // 2 - 0.5)) * resolution)
