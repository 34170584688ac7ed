# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps made of the files of point clouds and meshes."""

from collections.abc import Iterable
from os import PathLike
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from ..conversions._mesh import from_mesh
from ..conversions._point_layers import from_points
from ..errors import GridMapError
from ..map._grid_map import GridMap
from ..map._layer_names import select_layers
from ._clouds import load_mesh, load_points


def load_cloud(
    path: str | PathLike[str],
    layers: Iterable[str] | None = None,
    *,
    resolution: float | None = None,
    kind: Literal["points", "mesh"] | None = None,
    height_layer: str = "elevation",
    reduction: str = "max",
    min_height: float = -np.inf,
    max_height: float = np.inf,
    frame_id: str = "map",
) -> GridMap:
    """Return a map that covers a point cloud or a mesh.

    Args:
        path: a PCD, PLY, OBJ or STL file.
        layers: names of the layers to make: that of the heights and fields of the points; None
            makes all.
        resolution: side of a cell [m]; required.
        kind: "points" or "mesh"; None takes the mesh if the file has faces.
        height_layer: name of the layer of the heights.
        reduction: reduction of the heights of the points in a cell, as in `from_points`.
        min_height, max_height: points below and above are left out [m].
        frame_id: frame of the map.

    Raises:
        LayerNotFoundError: the file lacks a layer.
        GridMapError: `resolution` is missing, an option for points is given for a mesh, or the file
            cannot be read or makes no map.
    """
    mesh = None if kind == "points" else _mesh(path, required=kind == "mesh")
    points, fields = load_points(path) if mesh is None else (mesh[0], {})
    if resolution is None:
        lower, upper = _extent(path, points)
        size = " x ".join(f"{high - low:.6g}" for low, high in zip(lower, upper, strict=True))
        raise GridMapError(
            f"{path}: resolution: expected the side of a cell [m], got nothing; "
            f"the extent is {size} m"
        )
    wanted = select_layers(
        [height_layer, *(name for name in fields if name != height_layer)], layers
    )
    if mesh is not None:
        if (reduction, min_height, max_height) != ("max", -np.inf, np.inf):
            raise GridMapError(
                f"{path}: is a mesh; reduction, min_height and max_height are for points, and "
                "kind 'points' takes the vertices of a mesh"
            )
        grid_map = from_mesh(*mesh, resolution, height_layer, frame_id=frame_id)
    else:
        grid_map = from_points(
            points,
            resolution,
            {height_layer: reduction},
            fields={name: fields[name] for name in wanted if name != height_layer},
            min_height=min_height,
            max_height=max_height,
            frame_id=frame_id,
        )
    return grid_map.without_layers([name for name in grid_map if name not in wanted])


def describe_cloud(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the numbers of points and faces, the fields and the extent of a file."""
    mesh = _mesh(path, required=False)
    points, fields = load_points(path)
    lower, upper = _extent(path, points)
    faces = 0 if mesh is None else len(mesh[1])
    counts = {"points": len(points), "faces": faces, "fields": [*fields]}
    return counts | {"lower": lower, "upper": upper}


def _mesh(
    path: str | PathLike[str], *, required: bool
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]] | None:
    try:
        return load_mesh(path)
    except GridMapError:
        # A file without faces may still hold points; reading the points reports any other problem.
        if required:
            raise
        return None


def _extent(path: str | PathLike[str], points: npt.NDArray[Any]) -> tuple[list[float], list[float]]:
    """Return the smallest and the largest x, y, z of the finite points."""
    finite = points[np.isfinite(points[:, :3]).all(axis=1), :3]
    if not len(finite):
        raise GridMapError(f"{path}: no point is finite")
    return finite.min(axis=0).tolist(), finite.max(axis=0).tolist()
