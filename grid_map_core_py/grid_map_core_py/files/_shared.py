# SPDX-License-Identifier: BSD-3-Clause
"""Metadata, errors and lazily read maps, shared by the file formats."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from .. import errors
from .._arrays._checks import select_layers
from ..errors import GridMapError, LayerNotFoundError, LimitError, MissingPackageError
from ..limits import check_cells
from ..map._grid_map import GridMap

_KNOWN = (
    *(".npz", ".npy", ".zip", ".yaml", ".yml", ".json", ".csv", ".mcap", ".db3", ".bag", ".zarr"),
    *(".tif", ".tiff", ".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".gif", ".webp"),
    *(".pdf", ".svg", ".pcd", ".ply", ".obj", ".stl", ".bt", ".ot"),
)
"""Endings with a fixed meaning."""


def check_ending(path: str | PathLike[str], *own: str) -> None:
    """Refuse a name that ends like another kind of file."""
    ending = Path(path).suffix.lower()
    if ending in _KNOWN and ending not in own:
        raise GridMapError(f"{path}: expected a name that ends in {' or '.join(own)}, got {ending}")


@contextmanager
def storage_errors(file: Path, doing: str) -> Iterator[None]:
    """Turn every error of reading or writing a file into one GridMapError that names it.

    Args:
        file: the file.
        doing: "read" or "written".
    """
    try:
        yield
    except (LayerNotFoundError, MissingPackageError):
        raise
    except LimitError as error:
        if str(file) not in str(error):
            error.args = (f"{file}: {error}",)
        raise
    except OSError as error:
        reason = error.strerror or error.__cause__ or error
        raise GridMapError(f"{file}: cannot be {doing}: {reason}") from error
    # Libraries fail in many ways when a file is damaged.
    except Exception as error:
        text = f"{error} is missing" if isinstance(error, KeyError) else str(error).strip()
        first_line = text.splitlines()[0] if text else type(error).__name__
        raise GridMapError(f"{file}: cannot be {doing}: {first_line}") from error


@contextmanager
def naming(path: str | PathLike[str]) -> Iterator[None]:
    """Prefix errors with the name of a file."""
    try:
        yield
    except GridMapError as error:
        error.args = (f"{path}: {error}",)
        raise


def package_for(path: str | PathLike[str], kind: str, name: str) -> Any:
    """Return the package for a kind of file; the error says how to install it."""
    return errors.required(name, f"{path}: {kind}", f"pip install {name}")


def map_facts(grid_map: GridMap) -> dict[str, Any]:
    """Return frame, time, size, place and names of layers of a map, as JSON has them."""
    return {
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
    """A map in a file whose layers have not been read yet."""

    empty: GridMap
    """The map without its layers."""
    layers: Sequence[str]
    basic_layers: Sequence[str]
    read: Callable[[Sequence[str]], Iterable[ArrayLike]]
    """Returns layers in map order."""
    file: Path

    def load(self, layers: Iterable[str] | None) -> GridMap:
        """Return the map with the named layers; None means all."""
        wanted, size = select_layers(self.layers, layers), self.empty.size
        check_cells(f"{self.file}: map", size, len(wanted))
        grid_map = self.empty.with_layers(dict(zip(wanted, self.read(wanted), strict=True)))
        grid_map.basic_layers = [name for name in self.basic_layers if name in grid_map]
        return grid_map

    def facts(self) -> dict[str, Any]:
        """Return the same as `map_facts` of the whole map."""
        names = {"layers": [*self.layers], "basic_layers": [*self.basic_layers]}
        return map_facts(self.empty) | names
