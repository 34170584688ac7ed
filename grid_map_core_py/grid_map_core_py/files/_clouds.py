# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Point clouds and meshes from files.

PCD files are read by the package `pypcd4`, PLY, OBJ and STL files by `trimesh`. Neither is needed
unless such a file is to be read.
"""

import importlib
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ..conversions._packed_colors import color_vector_to_value
from ..conversions._point_layers import COLOR_FIELDS, as_colors
from ..errors import GridMapError, MissingPackageError

Fields: TypeAlias = dict[str, npt.NDArray[Any]]
"""(N,) values of the points by the name of the field."""

_MESHES = (".ply", ".obj", ".stl")


def load_points(path: str | PathLike[str]) -> tuple[npt.NDArray[Any], Fields]:
    """Read a point cloud, or the vertices of a mesh, from a PCD, PLY, OBJ or STL file.

    Args:
        path: the file; its ending selects the format.

    Returns:
        points: (N, 3) x, y, z, float32 or float64 as in the file; they may hold NaN. The viewpoint
            that a PCD file may name is not applied.
        fields: other values of each point in a PCD or PLY file, such as `intensity`. Colors come as
            one field `rgb` of packed colors, ready for `rasterize`. A PCD field of several numbers
            comes as several fields, `name__0000` and so on.

    Raises:
        GridMapError: the file is missing, damaged, of another format or without points, or the
            package that reads it is not installed.
    """
    file = Path(path)
    if file.suffix.lower() == ".pcd":
        table = _read_pcd(file)
    else:
        geometries = _read_mesh(file)
        table = _ply_table(geometries) or dict(zip("xyz", _vertices(geometries).T, strict=True))
    missing = [axis for axis in "xyz" if axis not in table]
    if missing:
        raise GridMapError(f"{file}: no field {missing[0]!r}, got {', '.join(table) or 'none'}")
    if not len(table["x"]):
        raise GridMapError(f"{file}: holds no points")
    points = np.column_stack([table.pop(axis) for axis in "xyz"])
    return points, _with_packed_colors(table)


def load_mesh(
    path: str | PathLike[str],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Read a mesh from a PLY, OBJ or STL file.

    Polygons come as triangles. The objects of an OBJ file come as one mesh. A binary PLY file can
    be read only if all its faces have the same number of vertices.

    Args:
        path: the file; its ending selects the format.

    Returns:
        vertices: (V, 3) x, y, z.
        faces: (F, 3) indices of vertices.

    Raises:
        GridMapError: the file is missing, damaged, of another format or without faces, or the
            package that reads it is not installed.
    """
    file = Path(path)
    meshes = [geometry for geometry in _read_mesh(file) if hasattr(geometry, "faces")]
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=False)]
    if not sum(map(len, faces)):
        raise GridMapError(f"{file}: holds no faces")
    return _vertices(meshes), np.concatenate(faces).astype(np.int64)


def _read_pcd(file: Path) -> Fields:
    """Return the fields of a PCD file by their names."""
    pypcd4 = _reader("pypcd4", file)
    try:
        cloud = pypcd4.PointCloud.from_path(file)
        # For a file with a single point the reader returns a 1-D array.
        rows = np.atleast_1d(cloud.pc_data)
        if len(rows) != cloud.points:
            raise ValueError(f"expected {cloud.points} points, got {len(rows)}")
    # A file may be damaged in any way, and the reader fails in as many.
    except Exception as error:
        raise GridMapError(f"{file}: cannot be read: {_first_line(error)}") from error
    # PCL names all padding "_"; the reader replaces it by unique names with this prefix.
    return {name: rows[name] for name in rows.dtype.names or () if not name.startswith("#$%&~~")}


def _read_mesh(file: Path) -> list[Any]:
    """Return the meshes and point clouds of a file as trimesh has them."""
    if file.suffix.lower() not in _MESHES:
        known = ", ".join(_MESHES)
        raise GridMapError(f"{file}: expected a file that ends in {known}, or .pcd for points")
    trimesh = _reader("trimesh", file)
    try:
        # Unprocessed: no vertex is merged or dropped.
        options = {"process": False, "skip_materials": True}
        geometries = list(trimesh.load_scene(file, **options).geometry.values())
        for geometry in geometries:
            _check_complete(geometry)
    except ImportError as error:
        # Trimesh would let another package guess what encoding this is.
        raise GridMapError(f"{file}: cannot be read: neither valid nor text in UTF-8") from error
    except Exception as error:
        raise GridMapError(f"{file}: cannot be read: {_first_line(error)}{_hint(error)}") from error
    if not geometries:
        raise GridMapError(f"{file}: cannot be read: nothing found in it")
    return geometries


def _reader(package: str, file: Path) -> Any:
    """Return the package that reads a file, which exists."""
    if not file.is_file():
        raise GridMapError(f"{file}: no such file")
    try:
        return importlib.import_module(package)
    except ImportError as error:
        remedy = f"pip install {package}"
        raise MissingPackageError(package, f"{file}: reading it", remedy) from error


def _first_line(error: Exception) -> str:
    """Return the first line of an error; details may follow in many lines."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def _hint(error: Exception) -> str:
    """Return a reason other than damage."""
    if "PLY is unexpected length" not in str(error):
        return ""
    return " (the faces of a binary PLY file must all have the same number of vertices)"


def _ply_elements(geometry: Any) -> Mapping[str, Any]:
    """Return the elements of a PLY file by their names, none for another file."""
    elements: Mapping[str, Any] = geometry.metadata.get("_ply_raw", {})
    return elements


def _check_complete(geometry: Any) -> None:
    """Refuse a PLY text that ends early and faces without their vertices, which trimesh accepts."""
    for name, element in _ply_elements(geometry).items():
        data = element.get("data", ())
        columns = list(data.values()) if isinstance(data, dict) else [data]
        found = min(map(len, columns), default=0)
        if found != element["length"]:
            raise ValueError(f"expected {element['length']} of {name}, got {found}")
    faces, vertices = np.asarray(getattr(geometry, "faces", ())), len(geometry.vertices)
    if faces.size and not 0 <= faces.min() <= faces.max() < vertices:
        raise ValueError(f"{vertices} vertices, but faces name {faces.min()} to {faces.max()}")


def _vertices(geometries: list[Any]) -> npt.NDArray[np.float64]:
    return np.concatenate([np.asarray(geometry.vertices, np.float64) for geometry in geometries])


def _ply_table(geometries: list[Any]) -> Fields:
    """Return the properties of a PLY file's vertices by their names, none for another file."""
    data = _ply_elements(geometries[0]).get("vertex", {}).get("data", {})
    names = data if isinstance(data, dict) else data.dtype.names or ()
    return {name: np.asarray(data[name]).reshape(-1) for name in names}


def _with_packed_colors(fields: Fields) -> Fields:
    """Return the fields with colors as one field of packed float32 without alpha."""
    channels = "red", "green", "blue"
    if all(name in fields for name in channels):
        rgb = np.column_stack([fields.pop(name) for name in channels])
        fields.pop("alpha", None)
        fields["rgb"] = color_vector_to_value(rgb)
    for name in COLOR_FIELDS:
        # Packed colors with alpha may be NaN when read as float.
        if name in fields and fields[name].dtype.itemsize == 4:
            fields["rgb"] = as_colors(fields.pop(name))
    return fields
