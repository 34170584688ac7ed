# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps made of the files of point clouds and meshes."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import from_mesh, from_points
from grid_map_core_py.errors import GridMapError, LayerNotFoundError
from grid_map_core_py.files import Fields, load_mesh, load_points

from .errors import CommandError
from .output import number


class Gridding(NamedTuple):
    """How a map is made of a cloud or mesh.

    Attributes:
        resolution: side of a cell [m].
        kind: "points" or "mesh"; None takes the mesh where there is one.
        layer: name of the layer of the heights.
        reduction: reduction of the heights of the points in a cell.
        min_height, max_height: points beyond are left out [m].
    """

    resolution: float | None
    kind: str | None = None
    layer: str = "elevation"
    reduction: str = "max"
    min_height: float = -np.inf
    max_height: float = np.inf


def read_cloud(path: str, gridding: Gridding, layers: list[str] | None) -> GridMap:
    """Return a map that covers a cloud or a mesh; other fields of the points become layers, too.

    Raises:
        CommandError: there is no resolution, or something that does not count for meshes.
        GridMapError: the file cannot be read, makes no map, or lacks a layer.
    """
    faces = None if gridding.kind == "points" else _mesh(path, required=gridding.kind == "mesh")
    if faces is None:
        points, fields = load_points(path)
    else:
        points, fields = faces[0], {}
    if gridding.resolution is None:
        raise CommandError(
            f"{path}: say with --resolution how large cells are to be [m]; "
            f"it extends over {_extent_text(path, points)} m"
        )
    _check_layers(layers, {gridding.layer, *fields})
    if faces is not None:
        _check_for_mesh(path, gridding)
        return from_mesh(*faces, gridding.resolution, gridding.layer)
    wanted = {name: field for name, field in fields.items() if layers is None or name in layers}
    return from_points(
        points,
        gridding.resolution,
        {gridding.layer: gridding.reduction},
        fields=_usable(wanted, gridding.layer),
        min_height=gridding.min_height,
        max_height=gridding.max_height,
    )


def cloud_info(path: str) -> dict[str, Any]:
    """Return what a file of points or of a mesh holds.

    Raises:
        GridMapError: it cannot be read.
    """
    mesh = _mesh(path, required=False)
    points, fields = load_points(path)
    lower, upper = _extent(path, points)
    return {
        "points": len(points),
        "faces": 0 if mesh is None else len(mesh[1]),
        "fields": [*fields],
        "lower": lower,
        "upper": upper,
    }


def _mesh(path: str, *, required: bool) -> tuple[npt.NDArray[Any], npt.NDArray[Any]] | None:
    try:
        return load_mesh(path)
    except GridMapError:
        # Without faces there are still points; what else is wrong is found when these are read.
        if required:
            raise
        return None


def _usable(fields: Fields, layer: str) -> Fields:
    """Return the fields that may become layers beside that of the heights."""
    return {name: values for name, values in fields.items() if name != layer}


def _check_layers(wanted: list[str] | None, available: set[str]) -> None:
    for name in wanted or ():
        if name not in available:
            raise LayerNotFoundError(name, sorted(available))


def _check_for_mesh(path: str, gridding: Gridding) -> None:
    of_points = ("reduction", "min_height", "max_height")
    defaults = Gridding._field_defaults
    if any(getattr(gridding, name) != defaults[name] for name in of_points):
        raise CommandError(
            f"{path}: is a mesh, and --reduce, --min-height and --max-height are for points; "
            "--as points takes its vertices"
        )


def _extent(path: str, points: npt.NDArray[Any]) -> tuple[list[float], list[float]]:
    """Return the smallest and largest x, y, z of the finite points; NaN cannot be said in JSON."""
    finite = points[np.isfinite(points[:, :3]).all(axis=1), :3]
    if not len(finite):
        raise GridMapError(f"{path}: no point is finite")
    return finite.min(axis=0).tolist(), finite.max(axis=0).tolist()


def _extent_text(path: str, points: npt.NDArray[Any]) -> str:
    lower, upper = _extent(path, points)
    return " x ".join(number(high - low) for low, high in zip(lower[:2], upper[:2], strict=True))
