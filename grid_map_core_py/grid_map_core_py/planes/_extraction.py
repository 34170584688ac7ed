# SPDX-License-Identifier: BSD-3-Clause
"""`extract_planes`: from a layer of heights to planar regions with lasting ids."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Layer
from ..errors import ConfigError, GridMapError, short
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._fits import Fit, fit_planes
from ._outlines import cleaned, components, outlines
from ._parameters import PlaneParameters
from ._regions import PlanarRegions
from ._segmentation import Cells, Splitter, planar_cells
from ._windows import local_planes

_DEFAULT = PlaneParameters()
_LEAST_FITTED = 4  # cells of a fit; three cells leave no residual


def extract_planes(
    grid_map: GridMap,
    layer: str = "elevation",
    parameters: PlaneParameters = _DEFAULT,
    previous: PlanarRegions | None = None,
) -> PlanarRegions:
    """Divide the planar parts of a map into regions, each with a plane and an outline.

    Cells whose height is not finite belong to no region. The same input yields the same result, bit
    for bit; the start index has no influence.

    Args:
        grid_map: the map. If it has a layer `variance` [m^2], regions in which all variances are
            positive and finite are fitted with the weights 1 / variance, and their covariance
            follows from the variances. Otherwise it follows from the residuals.
        layer: name of the layer of heights [m].
        parameters: thresholds.
        previous: regions of an earlier map in the same frame with the same resolution; the map may
            have moved. The region that shares the most cells with an old region keeps its id; if
            several old regions claim the same region, the one that shares the most cells wins. All
            other regions get new ids, which `previous` and the regions before it never used.

    Raises:
        LayerNotFoundError: the map has no layer `layer`.
        ConfigError: `parameters` is not a `PlaneParameters`.
        GridMapError: `previous` has another frame or resolution.
    """
    geometry = grid_map.geometry
    if not isinstance(parameters, PlaneParameters):
        expected = "PlaneParameters (see PlaneParameters.from_mapping)"
        raise ConfigError(f"parameters: expected {expected}, got {short(parameters)}")
    if previous is not None:
        _check_previous(previous, grid_map)
    heights = np.ascontiguousarray(grid_map.unwrapped(layer).T)
    windows = parameters.sliding_window_plane_extractor
    planes = local_planes(heights, geometry.resolution, parameters)
    cells = planar_cells(heights, planes)
    rounds = Splitter(cells, heights.shape, geometry.resolution, windows).split()
    rounds = cleaned(rounds, parameters.contour_extraction.marginSize)
    labels, count = components(rounds)
    variances = grid_map.unwrapped("variance") if "variance" in grid_map else None
    fit, scales, rms = _fitted(cells, labels, count, variances)
    slopes = -fit.slopes / geometry.resolution  # rows and columns run towards -x and -y
    steepest = math.tan(math.radians(windows.plane_inclination_threshold_degrees))
    sizes = np.bincount(labels.reshape(-1), minlength=count + 1)[1:]
    with np.errstate(invalid="ignore"):
        valid = np.hypot(*slopes.T) <= steepest
    valid &= (fit.counts >= _LEAST_FITTED) & (sizes >= windows.min_number_points_per_label)
    ids, next_id = _identify(labels, np.flatnonzero(valid) + 1, geometry, previous)
    # Regions are numbered in the order of their ids.
    kept = np.flatnonzero(valid)[np.argsort(ids)]
    ids = np.sort(ids)
    number_of = np.zeros(count + 1, np.int32)
    number_of[kept + 1] = np.arange(1, kept.size + 1)
    labels = number_of[labels]
    axes = geometry.axes_in_map_order()
    values = _values(fit, slopes, scales, geometry)
    fields = {name: value[kept] for name, value in (values | {"rms": rms, "cells": sizes}).items()}
    planarity = np.where(planes.known, planes.planar, np.float32(np.nan)).astype(np.float32)
    named = np.concatenate([[0], ids]).astype(np.int32)[labels]
    return PlanarRegions(
        named.T,
        planarity.T,
        geometry,
        grid_map.frame_id,
        {"ids": ids, **fields},
        outlines(labels, axes, rounds, kept.size),
        next_id,
    )


def _fitted(
    cells: Cells, labels: NDArray[np.int32], count: int, variances: Layer | None
) -> tuple[Fit, Any, Any]:
    """Return the final plane of each label, in cells, factors of the covariances, and the RMS."""
    groups = labels.reshape(-1).take(cells.places) - 1
    chosen = np.flatnonzero(cells.steady & (groups >= 0))
    cells, groups = cells.chosen(chosen), groups.take(chosen)
    points = cells.x, cells.y, cells.z
    weights = None
    is_weighted = np.zeros(count, np.bool_)
    if variances is not None:
        given = np.ascontiguousarray(variances.T).reshape(-1)[cells.places].astype(np.float64)
        usable = np.isfinite(given) & (given > 0)
        is_weighted = np.bincount(groups, ~usable, count) == 0
        weights = np.where(is_weighted[groups], 1.0 / np.where(usable, given, 1.0), 1.0)
    fit = fit_planes(groups, count, points, weights)
    residuals = (cells.z - fit.at(groups, cells.x, cells.y)) ** 2
    squares = np.bincount(groups, residuals, count)
    with np.errstate(divide="ignore", invalid="ignore"):
        scales = np.where(is_weighted, 1.0, squares / np.maximum(fit.counts - 3, 1))
        return fit, scales, np.sqrt(squares / fit.counts)


def _values(fit: Fit, slopes: Any, scales: Any, geometry: GridGeometry) -> dict[str, NDArray[Any]]:
    """Return centers, normals and covariances in meters."""
    first = np.array([axis[0] for axis in geometry.axes_in_map_order()])
    centers = np.column_stack([first - fit.centers * geometry.resolution, fit.heights])
    normals = np.column_stack([-slopes, np.ones(len(slopes))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    units = np.array([1.0, -1.0 / geometry.resolution, -1.0 / geometry.resolution])
    covariances = fit.covariances * scales[:, None, None] * np.outer(units, units)
    return {"centers": centers, "normals": normals, "covariances": covariances}


def _check_previous(previous: PlanarRegions, grid_map: GridMap) -> None:
    if not isinstance(previous, PlanarRegions):
        raise GridMapError(f"previous: expected PlanarRegions, got {short(previous)}")
    if previous.frame != grid_map.frame_id:
        expected = f"regions in the frame {grid_map.frame_id!r}"
        raise GridMapError(f"previous: expected {expected}, got {previous.frame!r}. Pass None")
    old, new = previous.geometry.resolution, grid_map.resolution
    if not math.isclose(old, new, rel_tol=1e-6):
        expected = f"regions with a resolution of {new:g} m"
        raise GridMapError(f"previous: expected {expected}, got {old:g} m. Pass None")


def _identify(
    labels: NDArray[np.int32],
    valid: NDArray[np.int64],
    geometry: GridGeometry,
    previous: PlanarRegions | None,
) -> tuple[NDArray[np.int64], int]:
    """Return the ids (R,) of the valid labels, and the next unused id."""
    ids = np.zeros(valid.size, np.int64)
    next_id = 1
    if previous is not None:
        next_id = previous._next_id
        number_of = np.full(int(labels.max(initial=0)) + 1, -1)
        number_of[valid] = np.arange(valid.size)
        kept = _claims(number_of[labels.T], geometry, previous)
        ids[list(kept)] = list(kept.values())
    fresh = ids == 0
    ids[fresh] = np.arange(next_id, next_id + fresh.sum())
    return ids, next_id + int(fresh.sum())


def _claims(numbers: Any, geometry: GridGeometry, previous: PlanarRegions) -> dict[int, int]:
    """Return the old ids that regions keep, by region; `numbers` (rows, cols) is -1 for none."""
    steps = (geometry.corner - previous.geometry.corner) / geometry.resolution
    if not (np.abs(steps) < 2**31).all():
        return {}
    rows, columns = np.rint(steps).astype(int)
    # Old cell (0, 0) is cell (rows, columns) of the new map.
    size, old_size = numbers.shape, previous.labels.shape
    both = []
    for first, count, old_count in zip((rows, columns), size, old_size, strict=True):
        start, stop = max(first, 0), min(first + old_count, count)
        both.append(
            (slice(start, max(stop, start)), slice(start - first, max(stop, start) - first))
        )
    (rows_new, rows_old), (columns_new, columns_old) = both
    new, old = numbers[rows_new, columns_new], previous.labels[rows_old, columns_old]
    shared = (new >= 0) & (old > 0)
    pairs, counts = np.unique(
        np.stack([old[shared].astype(np.int64), new[shared]]), axis=1, return_counts=True
    )
    order = np.argsort(-counts, kind="stable")
    olds, news = pairs[:, order]
    _, first = np.unique(olds, return_index=True)  # the largest share of each old region
    claims = np.sort(first)
    _, winners = np.unique(news[claims], return_index=True)
    return {int(news[claim]): int(olds[claim]) for claim in claims[winners]}
