# SPDX-License-Identifier: BSD-3-Clause
"""Convert point clouds to layers by reducing the points in each cell to one value."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import (
    Integers,
    Mask,
    Positions,
    as_finite,
    as_floats,
    as_number,
    as_numbers,
    as_pair,
    as_points,
)
from .._arrays._pieces import PIECE, slices
from ..errors import ConfigError, GeometryError, GridMapError, short
from ..limits import check_cells
from ..map._axis import BORDER_TOLERANCE
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..plugins import check
from ._point_reductions import COLOR_REDUCTIONS, REDUCTIONS, Reduction

HIGHEST: Mapping[str, str] = MappingProxyType({"elevation": "max"})
"""Default of `layers` in `rasterize`: `elevation`, the largest height in each cell."""

COLOR_FIELDS = ("rgb", "rgba", "color")
"""Names of fields with packed colors: 0xAARRGGBB, as integers or as the bits of float32 values."""

_RGB = np.uint32(0xFFFFFF)
_NO_COLOR = np.float32(np.nan).view(np.uint32) & _RGB


def rasterize(
    points: ArrayLike,
    grid_map: GridMap,
    layers: Mapping[str, str] = HIGHEST,
    *,
    fields: Mapping[str, ArrayLike] | None = None,
    field_reductions: Mapping[str, str] | None = None,
    min_height: float = -np.inf,
    max_height: float = np.inf,
) -> GridMap:
    """Return a map with layers computed from the points in each cell.

    Points that are not finite or outside the map are ignored. In cells without points, `count` is 0
    and all other reductions are NaN. `variance` is the population variance.

    Args:
        points: (N, 3) or wider, x, y, z [m], map frame; float32 or float64 in any memory order.
        layers: reduction of the point heights [m] for each layer name: `max`, `min`, `mean`,
            `median`, `first`, `last`, `variance` or `count`.
        fields: other point values (N,) by field name. Each field becomes a layer of the same name.
            Values that are not finite are ignored. The fields `rgb`, `rgba` and `color` contain
            packed colors, whose alpha is dropped.
        field_reductions: reductions by field name; the default is `mean`. Colors support only
            `mean` (per channel), `first`, `last` and `count`.
        min_height, max_height: inclusive height range [m]; other points are ignored.

    Returns:
        A map with the new layers, which replace existing layers of the same name. All other layers
        are shared with `grid_map`, as described in `GridMap.with_layers`.

    Raises:
        GeometryError: an array has the wrong shape or is not numeric.
        ConfigError: a reduction is unknown or does not support colors, or a limit is invalid.
    """
    limits = as_limits(min_height, max_height)
    return rasterize_counted(points, grid_map, layers, fields, field_reductions, limits)[0]


def rasterize_counted(
    points: ArrayLike,
    grid_map: GridMap,
    layers: Mapping[str, str],
    fields: Mapping[str, ArrayLike] | None,
    field_reductions: Mapping[str, str] | None,
    limits: tuple[float, float],
) -> tuple[GridMap, Mask]:
    """Return the result of `rasterize`, and a mask (N,) of the used points."""
    cloud = as_points(points)
    sources = _sources(cloud, layers, fields or {}, field_reductions or {})
    geometry = grid_map.geometry
    rows, cols = geometry.size
    made = {}
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        flat, counted = _located(cloud, geometry, limits)
        for name, (source, reduce) in sources.items():
            cells, values = flat, source[counted]
            # Heights within the limits are always finite.
            if name not in layers and not (finite := np.isfinite(values)).all():
                cells, values = cells[finite], values[finite]
            layer = reduce(cells, values, rows * cols)
            made[name] = layer.reshape(geometry.size, order="F")
    return grid_map.with_layers(GridMap.from_geometry(geometry).with_layers(made)), counted


def from_points(
    points: ArrayLike,
    resolution: float,
    layers: Mapping[str, str] = HIGHEST,
    *,
    length: ArrayLike | None = None,
    position: ArrayLike | None = None,
    fields: Mapping[str, ArrayLike] | None = None,
    field_reductions: Mapping[str, str] | None = None,
    min_height: float = -np.inf,
    max_height: float = np.inf,
    tight: bool = False,
    frame_id: str = "",
    timestamp: int = 0,
) -> GridMap:
    """Create a map from points. Arguments not listed here are as in `rasterize`.

    Without `length` and `position`, the map is just large enough for all points within the height
    limits. Its borders are at multiples of the resolution. The cells of maps from different clouds
    are then aligned.

    Args:
        resolution: side of a cell [m].
        length: (2,) side lengths of the map [m]; None means just large enough for all points.
        position: (2,) center of the map [m]. If None and `length` is given, the map is centered on
            the rectangle that encloses the points.
        tight: center the map on the rectangle that encloses the points, without alignment. Ignored
            if `length` or `position` is given.
        timestamp: timestamp of the map [ns].

    Raises:
        GridMapError: `length` or `position` is None, but no finite point is within the limits.
        LimitError: the map would have too many cells.
    """
    cloud = as_points(points)
    center = None if position is None else np.array(as_pair(position, "position"))
    lower = upper = np.zeros(2)
    if length is None or center is None:
        lower, upper = _extent(cloud, as_limits(min_height, max_height))
    if length is not None:
        middle = lower + 0.5 * (upper - lower) if center is None else center
        geometry = GridGeometry(length, resolution, middle)
    else:
        if center is not None:
            reach = np.maximum(upper - center, center - lower)
            lower, upper = center - reach, center + reach
        align = center is None and not tight
        count = sum(map(len, filter(None, (layers, fields))))
        geometry = fitting_geometry(
            lower, upper, resolution, hold_edges=True, align=align, layers=count
        )
    return rasterize(
        cloud,
        GridMap.from_geometry(geometry, frame_id=frame_id, timestamp=timestamp),
        layers,
        fields=fields,
        field_reductions=field_reductions,
        min_height=min_height,
        max_height=max_height,
    )


def as_colors(values: ArrayLike, name: str = "colors") -> NDArray[np.float32]:
    """Remove alpha from colors 0xAARRGGBB, which are integers or bits of float32 values."""
    given = np.asarray(values if isinstance(values, np.ndarray) else as_numbers(values, name))
    if given.dtype.kind in "iu":
        return (given.astype(np.uint32) & _RGB).view(np.float32)
    floats = np.ascontiguousarray(as_floats(values, name), np.float32)
    colors = floats.view(np.uint32) & _RGB
    # Opaque colors are also NaN as floats, but with different bits.
    missing = np.isnan(floats) & (colors == _NO_COLOR)
    return np.where(missing, np.float32(np.nan), colors.view(np.float32))


def fitting_geometry(
    lower: Positions,
    upper: Positions,
    resolution: float,
    *,
    hold_edges: bool,
    align: bool = False,
    layers: int = 1,
) -> GridGeometry:
    """Return the smallest grid that covers the rectangle from `lower` to `upper` (2,) [m].

    Args:
        hold_edges: include the -x and -y edges of the rectangle; maps exclude these borders.
        align: align the borders with multiples of the resolution, instead of centering the grid.
        layers: number of layers for the check of the memory limit.
    """
    resolution = as_finite(resolution, "resolution", "a positive number", above=0.0)
    rounding = BORDER_TOLERANCE + 4 * np.spacing(np.abs([lower, upper]).max())
    with np.errstate(over="ignore"):
        cells, tolerance = (upper - lower) / resolution, rounding / resolution
        if align:
            first = np.floor(lower / resolution + tolerance)
            if hold_edges:
                first = np.ceil(lower / resolution - tolerance) - 1
            size = np.ceil(upper / resolution - tolerance) - first
        else:
            size = np.floor(cells + tolerance) + 1 if hold_edges else np.ceil(cells - tolerance)
        size = np.maximum(size, 1)
        ends = " to ".join("({:g}, {:g})".format(*end) for end in (lower, upper))
        check_cells(f"extent from {ends} m in cells of {resolution:g} m", size.tolist(), layers)
    if not align:
        return GridGeometry(size * resolution, resolution, lower + 0.5 * (upper - lower))
    geometry = GridGeometry(size * resolution, resolution, (first + 0.5 * size) * resolution)
    if hold_edges and not geometry.is_inside(upper):
        # Due to rounding, the largest position is beyond the border.
        size = np.ceil(upper / resolution + tolerance) - first
        geometry = GridGeometry(size * resolution, resolution, (first + 0.5 * size) * resolution)
    return geometry


def as_limits(min_height: float, max_height: float) -> tuple[float, float]:
    lowest, highest = as_number(min_height, "min_height"), as_number(max_height, "max_height")
    if not lowest <= highest:
        raise ConfigError(
            f"min_height, max_height: expected ascending limits, got {lowest}, {highest}"
        )
    return lowest, highest


def _counted(points: NDArray[Any], limits: tuple[float, float]) -> Mask:
    """Return a mask (N,) of the points with finite heights within the limits."""
    z = np.ascontiguousarray(points[:, 2])
    counted: Mask = np.isfinite(z) & (z >= limits[0]) & (z <= limits[1])
    return counted


def _extent(points: NDArray[Any], limits: tuple[float, float]) -> tuple[Positions, Positions]:
    counted = _counted(points, limits)
    x, y = np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])
    counted &= np.isfinite(x) & np.isfinite(y)
    if not counted.any():
        raise GridMapError("points: expected a finite one within the height limits, got none")
    extremes = [cv2.minMaxLoc(axis, counted.view(np.uint8))[:2] for axis in (x, y)]
    return np.array([low for low, _ in extremes]), np.array([high for _, high in extremes])


def _located(
    points: NDArray[Any], geometry: GridGeometry, limits: tuple[float, float]
) -> tuple[Integers, Mask]:
    """Return the flat cells (n,) of the points to use, and a mask (N,) of these points."""
    found, counted = [np.empty(0, np.int64)], np.empty(len(points), np.bool_)
    for part in slices(len(points), PIECE):
        piece, here = points[part], counted[part]
        (rows, columns), inside = geometry.cells_at(piece[:, :2])
        here[:] = inside & _counted(piece, limits)
        found.append((rows + geometry.size[0] * columns)[here])
    return np.concatenate(found), counted


def _sources(
    cloud: NDArray[Any],
    layers: Mapping[str, str],
    fields: Mapping[str, ArrayLike],
    field_reductions: Mapping[str, str],
) -> dict[str, tuple[NDArray[Any], Reduction]]:
    given = {"layers": layers, "fields": fields, "field_reductions": field_reductions}
    for name, mapping in given.items():
        check(isinstance(mapping, Mapping), name, "a mapping from names", mapping)
    for name in layers.keys() & fields.keys():
        raise GridMapError(
            f"fields: expected other names than those of the layers, got {short(name)}"
        )
    for name in field_reductions.keys() - fields.keys():
        raise ConfigError(
            f"field_reductions: expected fields, of {list(fields)}, got {short(name)}"
        )
    heights = cloud[:, 2]
    sources = {name: (heights, _chosen(REDUCTIONS, name, kind)) for name, kind in layers.items()}
    for name, field in fields.items():
        is_color = name in COLOR_FIELDS
        read, kinds = (as_colors, COLOR_REDUCTIONS) if is_color else (as_floats, REDUCTIONS)
        values = read(field, f"field {name!r}")
        if values.shape != heights.shape:
            raise GeometryError(
                f"field {name!r}: expected shape {heights.shape}, got {values.shape}"
            )
        sources[name] = values, _chosen(kinds, name, field_reductions.get(name, "mean"))
    return sources


def _chosen(kinds: Mapping[str, Reduction], layer: str, reduction: str) -> Reduction:
    known = isinstance(reduction, str) and reduction in kinds
    check(known, f"reduction of {layer}", f"one of {', '.join(kinds)}", reduction)
    return kinds[reduction]
