# SPDX-License-Identifier: BSD-3-Clause
"""Loads point clouds and meshes as arrays or maps.

The package `pypcd4` reads PCD files, and `trimesh` reads PLY, OBJ and STL files.
"""

from collections.abc import Iterable
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from .._arrays._checks import select_layers
from ..conversions._mesh import from_mesh
from ..conversions._packed_colors import color_vector_to_value
from ..conversions._point_layers import COLOR_FIELDS, as_colors, from_points
from ..errors import GridMapError
from ..map._grid_map import GridMap
from ._shared import package_for, storage_errors

Fields: TypeAlias = dict[str, npt.NDArray[Any]]
"""Maps field names to point values (N,)."""

_MESHES = (".ply", ".obj", ".stl")


def load_points(path: str | PathLike[str]) -> tuple[npt.NDArray[Any], Fields]:
    """Read a point cloud, or the vertices of a mesh, from a PCD, PLY, OBJ or STL file.

    Args:
        path: the file; its ending selects the format.

    Returns:
        points: (N, 3) x, y, z, which may be NaN. The dtype is float32 or float64, as in the file.
            The viewpoint of a PCD file is ignored.
        fields: other point values in a PCD or PLY file by field name, such as `intensity`. Colors
            are packed into the field `rgb`, which `rasterize` accepts. A PCD field with several
            numbers per point is split into the fields `name__0000`, `name__0001` ...
    """
    file = Path(path)
    if file.suffix.lower() == ".pcd":
        pypcd4 = package_for(file, "PCD", "pypcd4")
        with storage_errors(file, "read"):
            cloud = pypcd4.PointCloud.from_path(file)
            # If a file has a single point, the reader may return a 0-D array.
            rows = np.atleast_1d(cloud.pc_data)
            if len(rows) != cloud.points:
                raise ValueError(f"expected {cloud.points} points, got {len(rows)}")
        # PCL names all padding fields "_"; the reader gives them unique names with this prefix.
        names = [name for name in rows.dtype.names or () if not name.startswith("#$%&~~")]
        table = {name: rows[name] for name in names}
    else:
        meshes = _read_meshes(file)
        # Only PLY files store vertex properties.
        data = meshes[0].metadata.get("_ply_raw", {}).get("vertex", {}).get("data", {})
        columns = data if isinstance(data, dict) else data.dtype.names or ()
        table = {name: np.asarray(data[name]).reshape(-1) for name in columns}
        table = table or dict(zip("xyz", _vertices(meshes).T, strict=True))
    missing = [axis for axis in "xyz" if axis not in table]
    if missing:
        raise GridMapError(f"{file}: no field {missing[0]!r}, got {', '.join(table) or 'none'}")
    if not len(table["x"]):
        raise GridMapError(f"{file}: holds no points")
    points = np.column_stack([table.pop(axis) for axis in "xyz"])
    channels = "red", "green", "blue"
    if all(name in table for name in channels):
        rgb = np.column_stack([table.pop(name) for name in channels])
        table.pop("alpha", None)
        table["rgb"] = color_vector_to_value(rgb)
    for name in COLOR_FIELDS:
        # Packed colors with alpha may be NaN as floats.
        if name in table and table[name].dtype.itemsize == 4:
            table["rgb"] = as_colors(table.pop(name))
    return points, table


def load_mesh(path: str | PathLike[str]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Read a mesh from a PLY, OBJ or STL file.

    Polygons are split into triangles, and the objects of an OBJ file are merged. A binary PLY file
    can be read only if all its faces have the same number of vertices.

    Args:
        path: the file; its ending selects the format.

    Returns:
        vertices: (V, 3) x, y, z.
        faces: (F, 3) vertex indices.
    """
    file = Path(path)
    meshes = [mesh for mesh in _read_meshes(file) if hasattr(mesh, "faces")]
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=False)]
    if not sum(map(len, faces)):
        raise GridMapError(f"{file}: holds no faces")
    return _vertices(meshes), np.concatenate(faces).astype(np.int64)


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
    tight: bool = False,
    frame_id: str = "map",
) -> GridMap:
    """Load a point cloud or a mesh, and return a map that covers it.

    `reduction`, `min_height`, `max_height` and `tight` are allowed for points only.

    Args:
        path: a PCD, PLY, OBJ or STL file.
        layers: names of the layers to create from the point heights and fields; None means all.
        resolution: side of a cell [m]; required.
        kind: "points" or "mesh"; None means "mesh" if the file has faces, else "points".
        height_layer: name of the height layer.
        reduction: method that computes the height of a cell from its points, such as "max"; see
            `rasterize`.
        min_height, max_height: height range [m]; other points are ignored.
        tight: if True, center the map on the points; if False, align the borders of the map with
            multiples of the resolution.
        frame_id: frame of the map.
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
    is_default = (reduction, min_height, max_height, tight) == ("max", -np.inf, np.inf, False)
    if mesh is not None and not is_default:
        raise GridMapError(
            f"{path}: is a mesh; reduction, min_height, max_height and tight are for points, "
            "and kind 'points' takes the vertices of a mesh"
        )
    with storage_errors(path, "read"):
        if mesh is not None:
            grid_map = from_mesh(*mesh, resolution, height_layer, frame_id=frame_id)
        else:
            grid_map = from_points(
                points,
                resolution,
                {height_layer: reduction},
                fields={name: fields[name] for name in wanted if name != height_layer},
                min_height=min_height,
                max_height=max_height,
                tight=tight,
                frame_id=frame_id,
            )
    return grid_map.without_layers([name for name in grid_map if name not in wanted])


def describe_cloud(path: str | PathLike[str]) -> dict[str, Any]:
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
        # The file may contain only points. Any other error recurs when the points are read.
        if required:
            raise
        return None


def _extent(path: str | PathLike[str], points: npt.NDArray[Any]) -> tuple[list[float], list[float]]:
    """Return the smallest and the largest x, y, z of the finite points."""
    finite = points[np.isfinite(points[:, :3]).all(axis=1), :3]
    if not len(finite):
        raise GridMapError(f"{path}: no point is finite")
    return finite.min(axis=0).tolist(), finite.max(axis=0).tolist()


def _read_meshes(file: Path) -> list[Any]:
    """Read the meshes and point clouds of a file as trimesh objects."""
    ending = file.suffix.lower()
    if ending not in _MESHES:
        known = ", ".join(_MESHES)
        raise GridMapError(f"{file}: expected a file that ends in {known}, or .pcd for points")
    trimesh = package_for(file, ending, "trimesh")
    with storage_errors(file, "read"):
        try:
            # Without processing, no vertex is merged or dropped.
            options = {"process": False, "skip_materials": True}
            scene = trimesh.load_scene(BytesIO(file.read_bytes()), ending, **options)
        except ImportError as error:
            # If text is not UTF-8, trimesh imports a package that may be missing.
            raise ValueError("neither valid nor text in UTF-8") from error
        except ValueError as error:
            hint = " (the faces of a binary PLY file must all have the same number of vertices)"
            is_uneven = "PLY is unexpected length" in str(error)
            raise ValueError(f"{error}{hint * is_uneven}") from error
        meshes = [*scene.geometry.values()]
        for mesh in meshes:
            _check_complete(mesh)
        if not meshes:
            raise ValueError("nothing found in it")
    return meshes


def _check_complete(mesh: Any) -> None:
    """Raise ValueError if vertices, faces or coordinates are missing or invalid."""
    vertices, faces = np.asarray(mesh.vertices), np.asarray(getattr(mesh, "faces", ()))
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ValueError(f"expected x, y, z of every vertex, got an array {vertices.shape}")
    for name, element in mesh.metadata.get("_ply_raw", {}).items():
        data = element.get("data", ())
        columns = list(data.values()) if isinstance(data, dict) else [data]
        found = min(map(len, columns), default=0)
        if found != element["length"]:
            raise ValueError(f"expected {element['length']} of {name}, got {found}")
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise ValueError(f"{len(vertices)} vertices, but faces name {faces.min()} to {faces.max()}")


def _vertices(meshes: list[Any]) -> npt.NDArray[np.float64]:
    return np.concatenate([np.asarray(mesh.vertices, np.float64) for mesh in meshes])
