# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Errors and metadata that the file formats share."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

from ..errors import GridMapError, LayerNotFoundError, MissingPackageError
from ..map._grid_map import GridMap


@contextmanager
def storage_errors(file: Path, doing: str) -> Iterator[None]:
    """Turn every error of reading or writing a file into one GridMapError that names it."""
    try:
        yield
    except (LayerNotFoundError, MissingPackageError):
        raise
    except OSError as error:
        raise GridMapError(f"{file}: cannot be {doing}: {error.strerror or error}") from error
    # A file may be damaged in any way, and the libraries fail in as many.
    except Exception as error:
        text = f"{error} is missing" if isinstance(error, KeyError) else str(error).strip()
        first_line = text.splitlines()[0] if text else type(error).__name__
        raise GridMapError(f"{file}: cannot be {doing}: {first_line}") from error


def package_for(path: str | PathLike[str], name: str) -> Any:
    """Return the package that reads or writes a file; the error says how to install it."""
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingPackageError(name, f"{path}: its format", f"pip install {name}") from error


def map_facts(
    grid_map: GridMap,
    layers: Iterable[str] | None = None,
    basic_layers: Iterable[str] | None = None,
) -> dict[str, Any]:
    """Return frame, time, size, place and names of layers of a map, as JSON has them.

    Args:
        grid_map: the map, perhaps without its layers.
        layers, basic_layers: names to list in place of the names of the map.
    """
    return {
        "frame_id": grid_map.frame_id,
        "timestamp": grid_map.timestamp,
        "size": [*grid_map.size],
        "resolution": grid_map.resolution,
        "length": grid_map.length.tolist(),
        "position": grid_map.position.tolist(),
        "start_index": [*grid_map.start_index],
        "layers": [*(grid_map.layers if layers is None else layers)],
        "basic_layers": [*(grid_map.basic_layers if basic_layers is None else basic_layers)],
    }
