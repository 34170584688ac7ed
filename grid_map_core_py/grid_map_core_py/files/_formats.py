# SPDX-License-Identifier: BSD-3-Clause
"""Registry of file formats, and the functions `load` and `save`."""

import inspect
import warnings
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

from ..errors import GridMapError, MissingPackageError, hint, short
from ..map._grid_map import GridMap
from ._clouds import describe_cloud, load_cloud
from ._geotiff import describe_geotiff, load_geotiff, save_geotiff
from ._image_files import HEIGHT_ENDINGS, load_height_image, save_height_image
from ._map_server import load_map_server, save_map_server
from ._npz import describe_npz, load_npz, save_npz
from ._shared import similar

GROUP = "grid_map_core_py.formats"


class MapRecord(Protocol):
    """A map in a file; the map is read on demand."""

    time: int
    """Recording time [ns]."""

    def grid_map(self, layers: Iterable[str] | None = None, *, unwrap: bool = True) -> GridMap:
        """Read the map; `unwrap=False` keeps the stored start index."""


@dataclass(frozen=True, kw_only=True)
class Format:
    """File format with functions that recognize, read and write files.

    The options of a format are the keyword parameters of its functions.

    Attributes:
        name: unique short name, such as "npz".
        description: short description for tables and messages.
        endings: file extensions, in lower case, such as ".npz".
        reads: `reads(path)` returns whether the format can read the path. Formats of folders need
            this function. It can also distinguish formats with the same extension. If None, the
            extension decides.
        writes: `writes(path)` returns whether the format can write to the path. If None, the
            extension decides.
        load: `load(path, layers=None, **options)` returns one map; None if reading is unsupported.
        save: `save(grid_map, path, **options)` writes one map; None if writing is unsupported.
        describe: `describe(path, **options)` returns the file metadata as JSON values, with the
            metadata of the map under the key "map". If None, the map is loaded to describe it.
        open_maps: for formats with several maps per file. `open_maps(path, **options)` returns a
            context manager, which yields a sequence of `MapRecord` with the additional attribute
            `topic`. The options are those of `load` except `layers` and `index`.
        save_maps: for formats with several maps per file. `save_maps(path, maps, **options)` writes
            all maps and returns their number. `maps` yields pairs (time, map); the time [ns] may be
            None.
        save_all: for formats that also store other messages, such as the clouds and poses of a bag.
            `save_all(source, path, **options)` copies all messages of the file `source` to `path`,
            and returns their number.
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
    save_all: Callable[..., int] | None = None


def options_of(function: Callable[..., object] | None, given: int = 1) -> tuple[str, ...]:
    return () if function is None else tuple(inspect.signature(function).parameters)[given:]


def load(
    path: str | PathLike[str],
    *,
    format: str | None = None,  # noqa: A002
    **options: Any,
) -> GridMap:
    """Load a map from a file or folder.

    The file name selects the format. If several formats share an ending, the first format that
    accepts all options is used: `load("a.tif")` reads a GeoTIFF, but
    `load("a.tif", resolution=0.1)` reads a height image. `formats()` lists the formats. The
    documentation page "Bags and files" lists their options.

    Args:
        path: the file or folder.
        format: name of the format; None selects the format by the file name.
        options: options of the format, such as `layers` (all formats), `resolution` (clouds,
            meshes, height images), `topic` and `index` (bags).

    Raises:
        LayerNotFoundError: the file does not contain a layer in `layers`.
        MissingPackageError: a package that the format needs is not installed.
        GridMapError: the file cannot be read, or its format or an option is unknown.
    """
    found = find_format(Path(path), options, name=format)
    return found.load(path, **options)  # type: ignore[misc]


def save(
    grid_map: GridMap,
    path: str | PathLike[str],
    *,
    format: str | None = None,  # noqa: A002
    **options: Any,
) -> None:
    """Write a map to a file or folder.

    The file name selects the format. If several formats share an ending, the first format that
    accepts all options is used. The file or folder is written atomically. An existing file or
    folder of the same format is replaced.

    Args:
        grid_map: the map.
        path: the file or folder.
        format: name of the format; None selects the format by the file name.
        options: options of the format, such as `compress` (.npz, GeoTIFF), `bits` (images), `mode`
            (Nav2's map_server), `topic` (bags).

    Raises:
        MissingPackageError: a package that the format needs is not installed.
        GridMapError: the file cannot be written, or its format or an option is unknown.
    """
    found = find_format(Path(path), options, name=format, writes=True)
    found.save(grid_map, path, **options)  # type: ignore[misc]


@cache
def formats() -> dict[str, Format]:
    """Return all formats by name: first built-in formats, then formats from entry points.

    A package adds a format with an entry point in the group `grid_map_core_py.formats`. The name of
    the entry point is the name of the format, and its value refers to a `Format`. A format that
    fails to load is skipped with a warning.
    """
    known = {one.name: one for one in _BUILT_IN}
    # Formats of this package come first, because the bag format accepts any folder.
    own = f"{__package__.partition('.')[0]}."
    entries = entry_points(group=GROUP)
    for entry in sorted(entries, key=lambda one: (not one.value.startswith(own), one.name)):
        try:
            known.setdefault(entry.name, entry.load())
        # A broken plug-in must not make other formats unusable.
        except Exception as error:
            warnings.warn(
                f"format {entry.name!r} of {entry.value}: cannot be loaded: {error}", stacklevel=2
            )
    return known


def find_format(
    path: Path, options: Iterable[str] = (), *, name: str | None = None, writes: bool = False
) -> Format:
    """Return the first format that can read or write a path and accepts all options."""

    def fits(one: Format) -> bool:
        test = one.writes if writes else one.reads
        return path.suffix.lower() in one.endings if test is None else test(path)

    usable = {n: one for n, one in formats().items() if (one.save if writes else one.load)}
    if name is None:
        fitting = [one for one in usable.values() if fits(one)]
    elif name in usable:
        fitting = [usable[name]]
    else:
        done = "written" if writes else "read"
        raise GridMapError(
            f"format: expected one that is {done}, {', '.join(usable)}, got {short(name)}"
            f"{hint(name, usable)}"
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
        f"({', '.join(takes[0]) or 'none'}), got {short(unknown)}{hint(unknown, takes[0])}"
    )


def _unknown(path: Path, usable: Iterable[Format], *, writes: bool) -> GridMapError:
    """Return the error for a path that no available format matches."""
    endings = {".mcap": "bag", ".db3": "bag", ".bt": "octomap", ".ot": "octomap"}
    kind = "bag" if (path / "metadata.yaml").exists() else endings.get(path.suffix.lower())
    if kind is not None and kind not in formats():
        return MissingPackageError("grid_map_ros_py", f"{path}: a {kind}")
    if writes and kind == "bag":
        text = "a bag is a folder; its name has no ending"
        return GridMapError(f"{path}: {text}: {path.with_suffix('')}")
    if not writes and not path.exists():
        return GridMapError(f"{path}: cannot be read: No such file or directory{similar(path)}")
    if not writes and path.suffix.lower() == ".rrd":
        text = "a recording of Rerun is written, not read; show it by"
        return GridMapError(f"{path}: {text} `rerun {path}`")

    def shown(one: Format) -> str:
        # Some endings can only be read, and a bag is written as a folder.
        test = one.writes if writes else None
        endings = [ending for ending in one.endings if test is None or test(Path(f"map{ending}"))]
        return " ".join(endings) or one.description

    known = ", ".join(f"{one.name} ({shown(one)})" for one in usable)
    expected = "a name" if writes else "a file or folder"
    return GridMapError(f"{path}: expected {expected} of one of the formats {known}")


_YAML = (".yaml", ".yml")

_BUILT_IN = (
    Format(
        name="npz",
        description="NumPy arrays, nothing is lost",
        endings=(".npz",),
        load=load_npz,
        save=save_npz,
        describe=describe_npz,
    ),
    Format(
        name="map_server",
        description="YAML file and image of nav2's map_server",
        endings=_YAML,
        reads=lambda path: (path / "map.yaml").is_file() or path.suffix.lower() in _YAML,
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
        endings=(*HEIGHT_ENDINGS, ".pgm", ".bmp"),
        writes=lambda path: path.suffix.lower() in HEIGHT_ENDINGS,
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
