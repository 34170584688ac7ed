# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Table of file formats; `load` and `save` choose a format by the file name."""

import inspect
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

from ..errors import GridMapError, MissingPackageError
from ..map._grid_map import GridMap
from ._clouds import describe_cloud, load_cloud
from ._geotiff import describe_geotiff, load_geotiff, save_geotiff
from ._height_image import load_height_image, save_height_image
from ._image_folder import YAML_NAME, load_images, part_of_maps, save_images
from ._map_server import load_map_server, save_map_server
from ._npz import describe_npz, load_npz, save_npz
from ._yaml_files import load_yaml

GROUP = "grid_map_core_py.formats"


class MapRecord(Protocol):
    """A map in a file that has not been read yet."""

    time: int
    """When it was recorded [ns]."""

    def grid_map(self, layers: Iterable[str] | None = None, *, unwrap: bool = True) -> GridMap:
        """Read the map; `unwrap=False` keeps its start index."""


@dataclass(frozen=True, kw_only=True)
class Format:
    """A file format: how to recognize, read and write it.

    The options of a format are the keyword parameters of its functions.

    Attributes:
        name: short and unique, such as "npz".
        description: a few words for tables and messages.
        endings: endings of file names, in lower case, such as ".npz".
        reads: returns whether a path can be read, for folders and for endings that several formats
            share; None goes by the endings.
        writes: returns whether a name can be written to; None compares the endings.
        load: `load(path, layers=None, **options)` returns one map; None if the format is not read.
        save: `save(grid_map, path, **options)` writes one map; None if it is not written.
        describe: `describe(path, **options)` quickly returns the metadata of a file as JSON values;
            "map" holds those of its map. None loads the map for them.
        open_maps: for formats of many maps: `open_maps(path, topic=None)` returns a context manager
            of a sequence of `MapRecord` with an attribute `topic`.
        save_maps: for formats of many maps: `save_maps(path, maps, **options)` writes pairs of
            time [ns] (or None) and map, one at a time, and returns their number.
    """

    name: str
    description: str
    endings: tuple[str, ...] = ()
    reads: Callable[[Path], bool] | None = None
    writes: Callable[[Path], bool] | None = None
    load: Callable[..., GridMap] | None = None
    save: Callable[..., object] | None = None
    describe: Callable[..., dict[str, Any]] | None = None
    open_maps: Callable[..., AbstractContextManager[Sequence[MapRecord]]] | None = None
    save_maps: Callable[..., int] | None = None

    def can_read(self, path: Path) -> bool:
        """Return whether this format can probably read a file or folder."""
        return self._fits(path, self.load, self.reads)

    def can_write(self, path: Path) -> bool:
        """Return whether a file name selects this format for writing."""
        return self._fits(path, self.save, self.writes)

    def _fits(self, path: Path, function: object, test: Callable[[Path], bool] | None) -> bool:
        if function is None:
            return False
        return path.suffix.lower() in self.endings if test is None else test(path)


def options_of(function: Callable[..., object] | None, given: int = 1) -> tuple[str, ...]:
    """Return the option names of a format's function, without its `given` first parameters."""
    return () if function is None else tuple(inspect.signature(function).parameters)[given:]


def load(
    path: str | PathLike[str],
    *,
    format: str | None = None,  # noqa: A002
    **options: Any,
) -> GridMap:
    """Return the map in a file or folder, in the format that its name selects.

    `formats()` lists the formats; [bags and files] in the documentation lists their options. If
    several formats share an ending, the first that has all given options is taken: `load("a.tif")`
    reads a GeoTIFF, `load("a.tif", resolution=0.1)` a plain height image.

    Args:
        path: the file or folder.
        format: name of the format; the default follows from the name of the file.
        options: options of the format, such as `layers` (all formats), `resolution` (clouds,
            meshes, height images), `topic` and `index` (bags).

    Raises:
        LayerNotFoundError: the file lacks a layer that `layers` names.
        MissingPackageError: a package that the format needs is not installed.
        GridMapError: the file cannot be read, its format or an option is not known.
    """
    found = format_to_read(Path(path), options, name=format)
    return found.load(path, **options)  # type: ignore[misc]


def save(
    grid_map: GridMap,
    path: str | PathLike[str],
    *,
    format: str | None = None,  # noqa: A002
    **options: Any,
) -> None:
    """Write a map to a file or folder, in the format that its name selects.

    The file or folder is written atomically; one of the same format is replaced. If
    several formats share an ending, the first that has all given options is taken.

    Args:
        grid_map: the map.
        path: the file or folder.
        format: name of the format; the default follows from the name of the file.
        options: options of the format, such as `compress` (.npz, GeoTIFF), `bits` (images), `mode`
            (nav2's map_server), `topic` (bags).

    Raises:
        MissingPackageError: a package that the format needs is not installed.
        GridMapError: the file cannot be written, its format or an option is not known.
    """
    found = format_to_write(Path(path), options, name=format)
    found.save(grid_map, path, **options)  # type: ignore[misc]


@cache
def formats() -> dict[str, Format]:
    """Return all formats by name: first the built-in ones, then those of other packages.

    A package adds a format by an entry point of the group `grid_map_core_py.formats`: the format's
    name and a `Format`. A format that cannot be loaded is left out, with a
    warning.
    """
    known = dict(BUILT_IN)
    for entry in entry_points(group=GROUP):
        try:
            known.setdefault(entry.name, entry.load())
        # Any error of a plug-in leaves the other formats usable.
        except Exception as error:
            warnings.warn(
                f"format {entry.name!r} of {entry.value}: cannot be loaded: {error}", stacklevel=2
            )
    return known


def format_to_read(path: Path, options: Iterable[str] = (), *, name: str | None = None) -> Format:
    """Return the format in which to read a file or folder.

    Args:
        path: the file or folder.
        options: names of options that the format must have.
        name: name of the format; None selects it by the path.

    Raises:
        GridMapError: no format fits, or it lacks an option.
    """
    return _chosen(path, options, name, writes=False)


def format_to_write(path: Path, options: Iterable[str] = (), *, name: str | None = None) -> Format:
    """Return the format to write; arguments and errors: see `format_to_read`."""
    return _chosen(path, options, name, writes=True)


def _chosen(path: Path, options: Iterable[str], name: str | None, *, writes: bool) -> Format:
    """Return the first format that fits and has all options."""
    usable = {
        one.name: one
        for one in formats().values()
        if (one.save if writes else one.load) is not None
    }
    if name is None:
        fitting = [
            one for one in usable.values() if (one.can_write if writes else one.can_read)(path)
        ]
    elif name in usable:
        fitting = [usable[name]]
    else:
        done = "written" if writes else "read"
        raise GridMapError(
            f"format: expected one that is {done}, {', '.join(usable)}, got {name!r}"
        )
    if not fitting:
        raise _unknown(path, usable.values(), writes=writes)
    given = [*options]
    takes = [options_of(one.save, 2) if writes else options_of(one.load) for one in fitting]
    for one, known in zip(fitting, takes, strict=True):
        if {*given} <= {*known}:
            return one
    unknown = next(option for option in given if option not in takes[0])
    raise GridMapError(
        f"{path}: {unknown}: expected an option of the format {fitting[0].name} "
        f"({', '.join(takes[0]) or 'none'}), got {unknown!r}"
    )


def _unknown(path: Path, usable: Iterable[Format], *, writes: bool) -> GridMapError:
    """Return the error that no format fits; the format may be that of a missing package."""
    endings = {".mcap": "bag", ".db3": "bag", ".bt": "octomap", ".ot": "octomap"}
    kind = "bag" if (path / "metadata.yaml").exists() else endings.get(path.suffix.lower())
    if kind is not None and kind not in formats():
        remedy = "build and source this workspace with ROS 2, or pip install it"
        return MissingPackageError("grid_map_ros_py", f"{path}: a {kind}", remedy)
    if not writes and not path.exists():
        return GridMapError(f"{path}: cannot be read: No such file or directory")
    known = ", ".join(f"{one.name} ({' '.join(one.endings) or one.description})" for one in usable)
    expected = "a name" if writes else "a file or folder"
    return GridMapError(f"{path}: expected {expected} of one of the formats {known}")


def _is_ours(path: Path) -> bool:
    """Return whether a path holds images that `save_images` wrote, not a map of nav2."""
    file = path / YAML_NAME if path.is_dir() else path
    if file.suffix.lower() not in (".yaml", ".yml"):
        return False
    if not file.exists():
        return file == path and file.name == YAML_NAME
    try:
        return part_of_maps(load_yaml(file)) is not None
    except GridMapError:
        return True


def _save_images(
    grid_map: GridMap,
    path: str | PathLike[str],
    *,
    layers: Iterable[str] | None = None,
    bits: int = 16,
    ranges: Mapping[str, tuple[float, float]] | None = None,
) -> None:
    """Write a folder of images; `path` is the folder or the YAML file in it."""
    file = Path(path)
    folder = file.parent if file.name == YAML_NAME else file
    save_images(grid_map, folder, layers, bits=bits, ranges=ranges)


def _is_of_map_server(path: Path) -> bool:
    is_yaml = path.suffix.lower() in (".yaml", ".yml")
    return (path / YAML_NAME).is_file() if path.is_dir() else is_yaml


_IMAGES = (".png", ".tif", ".tiff")

BUILT_IN = {
    one.name: one
    for one in (
        Format(
            name="npz",
            description="NumPy arrays, nothing is lost",
            endings=(".npz",),
            load=load_npz,
            save=save_npz,
            describe=describe_npz,
        ),
        Format(
            name="images",
            description="folder of PNG images and map.yaml",
            reads=_is_ours,
            writes=lambda path: path.name == YAML_NAME,
            load=load_images,
            save=_save_images,
        ),
        Format(
            name="map_server",
            description="YAML file and image of nav2's map_server",
            endings=(".yaml", ".yml"),
            reads=_is_of_map_server,
            load=load_map_server,
            save=save_map_server,
        ),
        Format(
            name="geotiff",
            description="GeoTIFF, one band per layer",
            endings=(".tif", ".tiff"),
            load=load_geotiff,
            save=save_geotiff,
            describe=describe_geotiff,
        ),
        Format(
            name="height_image",
            description="height map: gray PNG, TIFF, PGM or BMP image",
            endings=(*_IMAGES, ".pgm", ".bmp"),
            writes=lambda path: path.suffix.lower() in _IMAGES,
            load=load_height_image,
            save=save_height_image,
        ),
        Format(
            name="pcd",
            description="point cloud of PCL",
            endings=(".pcd",),
            load=load_cloud,
            describe=describe_cloud,
        ),
        Format(
            name="mesh",
            description="triangle mesh or its vertices",
            endings=(".ply", ".obj", ".stl"),
            load=load_cloud,
            describe=describe_cloud,
        ),
    )
}
