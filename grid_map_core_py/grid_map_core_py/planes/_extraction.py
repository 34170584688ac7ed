# SPDX-License-Identifier: BSD-3-Clause
"""`extract_planes`: from a layer of heights to planar regions with lasting ids."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Layer
from .._parameters import check
from ..errors import GridMapError
from ..map._grid_map import GridMap
from ._outlines import cleaned, components, outlines
from ._parameters import PlaneParameters
from ._regions import PlanarRegions
from ._segmentation import Splitter, fit_planes
from ._windows import Cells, planar_cells

_LEAST_FITTED = 4  # cells of a fit; three cells leave no residual


def extract_planes(
    grid_map: GridMap,
    layer: str = "elevation",
    parameters: PlaneParameters | None = None,
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
        parameters: thresholds; None means the defaults.
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
    parameters = PlaneParameters() if parameters is None else parameters
    check(isinstance(parameters, PlaneParameters), "parameters", "PlaneParameters", parameters)
    heights = np.ascontiguousarray(grid_map.unwrapped(layer).T)
    limits = parameters.sliding_window_plane_extractor
    cells, planar = planar_cells(heights, geometry.resolution, parameters)
    rounds = Splitter(heights.shape, limits).split(cells)
    rounds = cleaned(rounds, parameters.contour_extraction.marginSize)
    labels, count = components(rounds)
    variances = grid_map.unwrapped("variance") if "variance" in grid_map else None
    planes, is_fitted = _fitted(cells, labels, count, variances)
    planes["cells"] = np.bincount(labels.reshape(-1), minlength=count + 1)[1:]
    flattest = math.cos(math.radians(limits.plane_inclination_threshold_degrees))
    is_valid = is_fitted & (planes["normal"][:, 2] >= flattest)
    kept = np.flatnonzero(is_valid & (planes["cells"] >= limits.min_number_points_per_label))
    numbers = np.zeros(count + 1, np.int32)
    numbers[kept + 1] = np.arange(1, kept.size + 1)
    ids, next_id = _identify(numbers[labels.T], kept.size, grid_map, previous)
    # Regions are numbered in the order of their ids.
    kept, ids = kept[np.argsort(ids)], np.sort(ids)
    numbers[kept + 1] = np.arange(1, kept.size + 1)
    labels = numbers[labels]
    axes = geometry.axes_in_map_order()
    planes["center"][:, :2] += axes[0][0], axes[1][0]
    return PlanarRegions(
        np.append(0, ids).astype(np.int32)[labels].T,
        np.where(np.isfinite(heights), planar, np.float32(np.nan)).T,
        geometry,
        grid_map.frame_id,
        {"id": ids, **{name: values[kept] for name, values in planes.items()}},
        outlines(labels, rounds, axes, geometry.resolution),
        next_id,
    )


def _fitted(
    cells: Cells, labels: NDArray[np.int32], count: int, variances: Layer | None
) -> tuple[dict[str, NDArray[Any]], NDArray[np.bool_]]:
    """Return the plane of each label, by name of the attribute, and which planes are determined."""
    groups = labels.reshape(-1).take(cells.places) - 1
    chosen = np.flatnonzero(cells.is_exact & (groups >= 0))
    points, groups = cells.points.take(chosen, axis=1), groups.take(chosen)
    weights, is_weighted = np.ones(chosen.size), np.zeros(count, np.bool_)
    if variances is not None:
        given = (
            np.ascontiguousarray(variances.T).reshape(-1)[cells.places[chosen]].astype(np.float64)
        )
        is_usable = np.isfinite(given) & (given > 0)
        is_weighted = np.bincount(groups, ~is_usable, count) == 0
        is_used = is_weighted[groups]
        weights[is_used] /= given[is_used]
    fit, covariances = fit_planes(groups, count, points, weights)
    counts = np.bincount(groups, minlength=count)
    squares = np.bincount(groups, (points[2] - fit.at(groups, points)) ** 2, count)
    is_fitted = (counts >= _LEAST_FITTED) & np.isfinite(squares)
    scales = np.where(is_weighted, 1.0, squares / np.maximum(counts - 3, 1))
    normals = np.column_stack([-fit.slopes, np.ones(count)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return {
        "normal": normals,
        "center": fit.centers,
        "covariance": covariances * scales[:, None, None],
        "rms": np.sqrt(squares / np.maximum(counts, 1)),
    }, is_fitted


def _identify(
    numbers: NDArray[np.int32], count: int, grid_map: GridMap, previous: PlanarRegions | None
) -> tuple[NDArray[np.int64], int]:
    """Return the ids (count,) of regions, and the next unused id.

    Args:
        numbers: (rows, cols) number of the region of each cell, 1 to `count`; 0 for none.
    """
    if previous is None:
        return np.arange(1, count + 1), count + 1
    _check_previous(previous, grid_map)
    geometry = previous.geometry
    shift = np.rint((grid_map.geometry.corner - geometry.corner) / geometry.resolution)
    places = np.argwhere(previous.labels) + np.clip(shift, -(2**31), 2**31).astype(np.int64)
    old = previous.labels[previous.labels > 0].astype(np.int64)
    on_map = ((places >= 0) & (places < numbers.shape)).all(axis=1)
    new = numbers[tuple(places[on_map].T)]
    pairs, shared = np.unique(old[on_map] * (count + 1) + new, return_counts=True)
    ids = np.zeros(count + 1, np.int64)
    claimed = {}
    for pair in pairs[np.argsort(-shared, kind="stable")].tolist():
        number, region = divmod(pair, count + 1)
        if region and number not in claimed:
            claimed[number] = region
            ids[region] = ids[region] or number
    fresh = np.flatnonzero(ids[1:] == 0)
    ids[fresh + 1] = previous._next_id + np.arange(fresh.size)
    return ids[1:], previous._next_id + fresh.size


def _check_previous(previous: PlanarRegions, grid_map: GridMap) -> None:
    old, new = previous.geometry.resolution, grid_map.resolution
    if previous.frame != grid_map.frame_id:
        expected = f"regions in the frame {grid_map.frame_id!r}"
        raise GridMapError(f"previous: expected {expected}, got {previous.frame!r}. Pass None")
    if not math.isclose(old, new, rel_tol=1e-6):
        expected = f"regions with a resolution of {new:g} m"
        raise GridMapError(f"previous: expected {expected}, got {old:g} m. Pass None")
