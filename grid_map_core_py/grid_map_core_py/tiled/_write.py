# SPDX-License-Identifier: BSD-3-Clause
"""Maps into stores that exist: the finite cells of a map replace those of the store."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Layer, select_layers
from ..errors import GeometryError, GridMapError, OutOfMapError
from ..map._grid_map import GridMap
from ..map._merge import check_frames, lines_under
from ._source import Tiles, Window, common, within
from ._stores import StoreSource
from ._tiled_map import TiledMap
from ._zarr import check_local, locked, open_layer, store_errors

_LARGEST_DIFFERENCE = 1e-6
"""Largest difference of two resolutions that count as the same, relative."""


def write(
    site: TiledMap,
    grid_map: GridMap,
    position: ArrayLike | None = None,
    layers: Iterable[str] | None = None,
) -> None:
    """Merge a map into a store; see `TiledMap.write`."""
    source = site.source
    if not isinstance(source, StoreSource):
        raise GridMapError(
            f"expected a map of a Zarr store to write to, got one of {type(source).__name__}. "
            "Write it into a store first, by to_zarr"
        )
    path = check_local(source.path)
    check_frames(site.frame_id, grid_map)
    _check_resolution(site, grid_map)
    names = select_layers(grid_map, layers)
    if lacking := [name for name in names if name not in site.layers]:
        raise GridMapError(
            f"{path}: the store lacks the layers {', '.join(lacking)} of the map; it has "
            f"{', '.join(site.layers)}. The option 'layers' names those to write"
        )
    if position is not None:
        grid_map = grid_map._with({**grid_map}, grid_map.geometry.at(position))
    window, lines = _under(site, grid_map)
    with store_errors(path, "written"), locked(path):
        for name in names:
            _merge(source, name, window, lines, grid_map[name])


def _check_resolution(site: TiledMap, grid_map: GridMap) -> None:
    expected, found = site.resolution, grid_map.resolution
    if abs(found - expected) > _LARGEST_DIFFERENCE * expected:
        raise GeometryError(
            f"grid_map: expected cells of {expected:g} m as in the store, got {found:g} m. "
            "Resample it first, by add_data_from into a map of this resolution"
        )


def _under(site: TiledMap, grid_map: GridMap) -> tuple[Window, list[NDArray[Any]]]:
    """Return the cells of the store whose centers are on a map, and where they are in its buffer.

    Returns:
        window: the cells of the store.
        lines: rows and columns of the map under those of the window, buffer indices.
    """
    outer, inner = site.geometry, grid_map.geometry
    border = outer.resolution
    near = outer.box(inner.corner - inner.length - border, inner.corner + border)
    window, lines = [], []
    for axis, (part, centers) in enumerate(zip(near, outer.axes_in_map_order(), strict=True)):
        found, inside = lines_under(centers[part], grid_map, axis)
        run = np.flatnonzero(inside)
        if not run.size:
            raise OutOfMapError(
                f"grid_map: no cell of it is on the store: {inner.place}; store: {outer.place}"
            )
        window.append(slice(part.start + int(run[0]), part.start + int(run[-1]) + 1))
        lines.append(found[inside])
    return (window[0], window[1]), lines


def _merge(
    source: StoreSource, name: str, window: Window, lines: list[NDArray[Any]], layer: Layer
) -> None:
    """Merge a layer into the chunks of the store that it touches, one after the other."""
    path, array = Path(source.path), open_layer(source.path, name)
    stored, rows_first = source.opened_to_write(name)

    def in_order(place: Window) -> Window:
        return place if rows_first else place[::-1]

    for chunk in Tiles(array.shape, array.chunks).touching(in_order(stored.mirrored(window))):
        place = stored.mirrored(in_order(chunk))
        shared = common(place, window)
        rows, columns = (
            line[part] for line, part in zip(lines, within(shared, window), strict=True)
        )
        values = layer[rows[:, None], columns]
        finite = np.isfinite(values)
        if not finite.any():
            continue
        with store_errors(path / name, "written"):
            cells = array[chunk]
            view = stored.turned(cells if rows_first else cells.T)[within(shared, place)]
            np.copyto(view, values, where=finite)
            array[chunk] = cells
