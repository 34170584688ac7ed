# SPDX-License-Identifier: BSD-3-Clause
"""Helpers for the file formats: errors, metadata, lazily read maps, atomic writing and YAML."""

import os
import re
import secrets
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

import yaml
from numpy.typing import ArrayLike

from .. import errors
from .._arrays._checks import select_layers
from .._unfinished import remove, unfinished
from ..errors import GridMapError, LayerNotFoundError, MissingPackageError
from ..limits import check_cells
from ..map._grid_map import GridMap

_KNOWN = (
    *(".npz", ".npy", ".zip", ".yaml", ".yml", ".json", ".csv", ".mcap", ".db3", ".bag", ".zarr"),
    *(".tif", ".tiff", ".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".gif", ".webp"),
    *(".pdf", ".svg", ".pcd", ".ply", ".obj", ".stl", ".bt", ".ot"),
)
"""File extensions of common formats; `check_ending` rejects them for files of other formats."""


def check_ending(path: str | PathLike[str], *own: str) -> None:
    """Raise `GridMapError` if a path has the extension of another known format."""
    ending = Path(path).suffix.lower()
    if ending in _KNOWN and ending not in own:
        raise GridMapError(f"{path}: expected a name that ends in {' or '.join(own)}, got {ending}")


@contextmanager
def storage_errors(file: str | PathLike[str], doing: str) -> Iterator[None]:
    """Convert exceptions to `GridMapError` with the path; `doing` is "read" or "written"."""
    try:
        yield
    except (LayerNotFoundError, MissingPackageError):
        raise
    except GridMapError as error:
        if str(file) not in str(error):
            error.args = (f"{file}: {error}",)
        raise
    except OSError as error:
        reason = error.strerror or error.__cause__ or error
        raise GridMapError(f"{file}: cannot be {doing}: {reason}{similar(Path(file))}") from error
    # Libraries raise errors of many classes if a file is damaged.
    except Exception as error:
        text = f"{error} is missing" if isinstance(error, KeyError) else str(error).strip()
        first_line = text.splitlines()[0] if text else type(error).__name__
        raise GridMapError(f"{file}: cannot be {doing}: {first_line}") from error


def similar(file: Path) -> str:
    """Return a hint that names a file similar to the missing `file`, or "" without any."""
    known = [] if file.exists() or not file.parent.is_dir() else file.parent.iterdir()
    # Names that have only the ending in common are not similar.
    names = (one.name for one in known if errors.hint(one.stem, [file.stem]))
    return errors.hint(file.name, names)


def package_for(path: str | PathLike[str], kind: str, name: str) -> Any:
    return errors.required(name, f"{path}: {kind}")


def say_crs_is_lost(grid_map: GridMap, kind: str, stacklevel: int = 3) -> None:
    """Warn if a file or message cannot store the reference system of a map."""
    if grid_map.crs:
        text = f"crs: {kind} cannot hold the coordinate reference system of the map; it is lost. "
        warnings.warn(f"{text}A GeoTIFF, Zarr or .npz file keeps it", stacklevel=stacklevel)


def map_facts(grid_map: GridMap) -> dict[str, Any]:
    """Return all attributes of a map except the layer values, as JSON values."""
    crs = grid_map.crs
    with suppress(Exception):  # pyproj is missing, or `crs` is invalid
        crs = ":".join(import_module("pyproj").CRS.from_user_input(crs).to_authority() or [crs])
    facts: dict[str, Any] = {"crs": crs} if crs else {}
    facts |= {"origin": [*grid_map.origin]} if any(grid_map.origin) else {}
    return facts | {
        "frame_id": grid_map.frame_id,
        "timestamp": grid_map.timestamp,
        "size": [*grid_map.size],
        "resolution": grid_map.resolution,
        "length": grid_map.length.tolist(),
        "position": grid_map.position.tolist(),
        "start_index": [*grid_map.start_index],
        "layers": [*grid_map.layers],
        "basic_layers": [*grid_map.basic_layers],
    }


@dataclass(frozen=True)
class StoredMap:
    """A map in a file; its layers are read on demand."""

    empty: GridMap
    """The map without its layers."""
    layers: Sequence[str]
    basic_layers: Sequence[str]
    read: Callable[[Sequence[str]], Iterable[ArrayLike]]
    """Function that reads the layers with the given names; each array is in map order."""
    file: Path

    def load(self, layers: Iterable[str] | None) -> GridMap:
        wanted, size = select_layers(self.layers, layers), self.empty.size
        check_cells(f"{self.file}: map", size, len(wanted))
        grid_map = self.empty.with_layers(dict(zip(wanted, self.read(wanted), strict=True)))
        grid_map.basic_layers = [name for name in self.basic_layers if name in grid_map]
        return grid_map

    def facts(self) -> dict[str, Any]:
        names = {"layers": [*self.layers], "basic_layers": [*self.basic_layers]}
        return map_facts(self.empty) | names


# --- atomic writing -------------------------------------------------------------------------------


@contextmanager
def new_file(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path whose file replaces the file at `path` on success."""
    with _beside(path) as (temporary, target):
        yield temporary
        _sync(temporary)
        temporary.replace(target)


@contextmanager
def new_folder(path: str | PathLike[str], check_old: Callable[[Path], object]) -> Iterator[Path]:
    """Yield an empty temporary folder that replaces the folder at `path` on success.

    `check_old` raises an error if the existing file or folder must not be replaced.
    """
    with _beside(path) as (temporary, target):
        if target.exists():
            check_old(target)
        temporary.mkdir()
        yield temporary
        for file in temporary.iterdir():
            _sync(file)
        if target.exists():
            check_old(target)
        replace_folder(temporary, target)


def replace_folder(temporary: Path, target: Path) -> None:
    """Replace the folder `target` with `temporary`, or restore it after an error."""
    if not target.exists():
        temporary.rename(target)
        return
    old = target.with_name(f".{target.name}.{secrets.token_hex(4)}.old")
    target.rename(old)
    try:
        temporary.rename(target)
    except OSError:
        old.rename(target)
        raise
    remove(old)


@contextmanager
def _beside(path: str | PathLike[str]) -> Iterator[tuple[Path, Path]]:
    """Yield a temporary path in the folder of `path`, and `path` with resolved links."""
    target = Path(path).resolve()
    if not target.parent.is_dir():
        raise FileNotFoundError(2, f"there is no folder {Path(path).parent}", str(path))
    name = target.with_name(f".{target.name}.{secrets.token_hex(4)}.partial")
    try:
        with unfinished(name) as temporary:
            yield temporary, target
    except OSError as error:
        # Users know `path`, but not the temporary path.
        if str(name) in str(error.filename):
            error.filename, error.filename2 = str(path), None
        raise


def _sync(path: Path) -> None:
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


# --- YAML -----------------------------------------------------------------------------------------


class _Loader(yaml.SafeLoader):
    """YAML loader that reads `1e-3` as a number and rejects duplicate keys."""

    def flatten_mapping(self, node: Any) -> None:
        """Check for duplicate keys before merge keys (`<<`) are expanded."""
        if not hasattr(node, "checked"):
            node.checked, known = True, set()
            for key, _ in node.value:
                if isinstance(key, yaml.ScalarNode) and key.value in known:
                    problem = f"{key.value!r:.100} occurs twice"
                    raise yaml.constructor.ConstructorError(None, None, problem, key.start_mark)
                known.add(key.value if isinstance(key, yaml.ScalarNode) else None)
        super().flatten_mapping(node)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def load_yaml(path: str | PathLike[str]) -> Any:
    """Read a YAML file in which `1e-3` is a number, as in ROS, and keys are unique."""
    try:
        text = Path(path).read_bytes()
    except OSError as error:
        reason = f"{error.strerror or error}{similar(Path(path))}"
        raise GridMapError(f"{path}: cannot be read: {reason}") from error
    return parse_yaml(text, path)


def parse_yaml(text: str | bytes, name: object) -> Any:
    """Parse a YAML text. Error messages begin with `name`."""
    try:
        return yaml.load(text, _Loader)
    # A value that does not match its tag, such as `!!int x`, may cause an error of any class.
    except Exception as error:
        problem = " ".join(str(error).split())
        raise GridMapError(f"{name}: no valid YAML: {problem:.300}") from error
