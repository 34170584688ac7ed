# SPDX-License-Identifier: BSD-3-Clause
"""Finds planar regions in a height layer, and keeps their ids from one map to the next.

Images in this module are transposed layers (cols, rows) in C order.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Layer, Mask
from .._parameters import check
from ..errors import GridMapError
from ..map._grid_map import GridMap
from ._parameters import PlaneParameters
from ._regions import PlanarRegions
from ._segmentation import Cells, Image, Numbers, Splitter, above_planes, fit_planes, planar_cells

_LEAST_FITTED = 4  # cells of a fit; three cells leave no residual


def extract_planes(
    grid_map: GridMap,
    layer: str = "elevation",
    parameters: PlaneParameters | None = None,
    previous: PlanarRegions | None = None,
) -> PlanarRegions:
    """Find the planar regions of a map, each with a plane and an outline.

    Cells without a finite height belong to no region. The same map yields exactly the same result,
    whatever its start index is.

    Args:
        grid_map: the map. If it has a layer `variance` [m^2], the layer is used in regions where
            all variances are positive and finite: cells have the weight 1 / variance, and the
            covariance of the plane is computed from the variances. In other regions, all cells have
            the same weight, and the covariance is computed from the residuals.
        layer: name of the height layer [m].
        parameters: thresholds; None means the defaults.
        previous: regions of an earlier map with the same frame and resolution; the map may have
            moved since. The id of each earlier region goes to the new region with which it shares
            the most cells. If several ids go to the same new region, it gets the id of the earlier
            region with the most shared cells. All other regions get new ids.

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
    labels, outlines = _traced(_cleaned(rounds, parameters.contour_extraction.marginSize))
    variances = grid_map.unwrapped("variance") if "variance" in grid_map else None
    planes, is_fitted = _fitted(cells, labels, len(outlines), variances)
    planes["cells"] = np.bincount(labels.reshape(-1), minlength=len(outlines) + 1)[1:]
    flattest = math.cos(math.radians(limits.plane_inclination_threshold_degrees))
    is_kept = is_fitted & (planes["normal"][:, 2] >= flattest)
    is_kept &= planes["cells"] >= limits.min_number_points_per_label
    ids, next_id = _identify(labels.T, is_kept, grid_map, previous)
    # Regions are in the order of their ids.
    kept = np.flatnonzero(is_kept)
    kept = kept[np.argsort(ids[kept])]
    x, y = geometry.axes_in_map_order()
    planes["center"][:, :2] += x[0], y[0]
    planes["offset"] = (planes["normal"] * planes["center"]).sum(axis=1)
    return PlanarRegions(
        np.append(0, ids).astype(np.int32)[labels].T,
        np.where(np.isfinite(heights), planar, np.float32(np.nan)).T,
        geometry,
        grid_map.frame_id,
        {"id": ids[kept], **{name: values[kept] for name, values in planes.items()}},
        [outlines[number] for number in kept],
        next_id,
    )


def _cleaned(rounds: Image, margin: int) -> Image:
    """Remove cells until no outline through the centers of border cells touches itself.

    A border of `margin` cells is removed first. In the result, every cell belongs to a block of 2 x
    2 cells with the same number.
    """
    image = np.pad(rounds, 1)
    if margin:
        box = np.ones((2 * margin + 1, 2 * margin + 1))
        image[cv2.erode(image, box) != cv2.dilate(image, box)] = 0
    a, b, c, d = image[:-1, :-1], image[:-1, 1:], image[1:, :-1], image[1:, 1:]  # views
    while True:
        blocks = np.zeros(image.shape, np.uint8)
        blocks[:-1, :-1] = (a == b) & (a == c) & (a == d)
        image *= cv2.dilate(blocks, np.ones((2, 2)), anchor=(1, 1))
        falling = (a == d) & (a != b) & (a != c) & (a > 0)
        rising = (b == c) & (a != b) & (b != d) & (b > 0)
        if not (falling.any() or rising.any()):
            return image[1:-1, 1:-1]
        a[falling] = 0
        b[rising] = 0


def _traced(rounds: Image) -> tuple[NDArray[np.int32], list[list[Image]]]:
    """Label connected cells with the same positive number, and trace their outlines.

    Returns:
        labels: image of labels from 1 on, 0 for none.
        outlines: for each label, a list of arrays (P, 2) of map rows and columns. The outer outline
            comes first (counter-clockwise in the map), then the holes (clockwise).
    """
    labels, outlines = np.zeros(rounds.shape, np.int32), list[list[Image]]()
    for number in np.flatnonzero(np.bincount(rounds.reshape(-1))[1:]) + 1:
        mask = (rounds == number).view(np.uint8)
        count, own = cv2.connectedComponents(mask, connectivity=4, ltype=cv2.CV_32S)
        np.add(own, len(outlines), out=labels, where=own > 0)
        outlines += ([] for _ in range(count - 1))
        # The holes of an outline follow it.
        for contour in cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)[0]:
            x, y = contour[0, 0]
            outlines[labels[y, x] - 1].append(contour[::-1, 0])
    return labels, outlines


def _fitted(
    cells: Cells, labels: NDArray[np.int32], count: int, variances: Layer | None
) -> tuple[dict[str, NDArray[Any]], Mask]:
    """Return the plane attributes of N labels, and a mask (N,) of labels with a fitted plane."""
    groups = labels.reshape(-1)[cells.places].astype(np.int64) - 1
    chosen = np.flatnonzero(cells.is_exact & (groups >= 0))
    points, groups = cells.points.take(chosen, axis=1), groups[chosen]
    weights: Numbers | float = 1.0
    is_weighted = np.zeros(count, np.bool_)
    if variances is not None:
        given = variances.T.reshape(-1)[cells.places[chosen]].astype(np.float64)
        is_usable = np.isfinite(given) & (given > 0)
        is_weighted = np.bincount(groups, ~is_usable, count) == 0
        weights = 1 / np.where(is_weighted[groups], given, 1.0)
    fits, centers, covariances = fit_planes(groups, count, points, weights)
    counts = np.bincount(groups, minlength=count)
    squares = np.bincount(groups, above_planes(points, fits, groups) ** 2, count)
    is_fitted = (counts >= _LEAST_FITTED) & np.isfinite(squares)
    scales = np.where(is_weighted, 1.0, squares / np.maximum(counts - 3, 1))
    normals = np.column_stack([-fits[0], -fits[1], np.ones(count)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return {
        "normal": normals,
        "center": centers.T,
        "covariance": covariances * scales[:, None, None],
        "rms": np.sqrt(squares / np.maximum(counts, 1)),
    }, is_fitted


def _identify(
    labels: NDArray[np.int32], is_kept: Mask, grid_map: GridMap, previous: PlanarRegions | None
) -> tuple[NDArray[np.int64], int]:
    """Return the ids (N,) of labels 1 to N, 0 if not in `is_kept`, and the next unused id."""
    ids, next_id = np.zeros(1 + is_kept.size, np.int64), 1
    check(isinstance(previous, PlanarRegions | None), "previous", "PlanarRegions", previous)
    if previous is not None:
        if not previous.fits(grid_map):
            expected = f"regions in {grid_map.frame_id!r} with cells of {grid_map.resolution:g} m"
            found = f"{previous.frame!r} with cells of {previous.geometry.resolution:g} m"
            raise GridMapError(f"previous: expected {expected}, got {found}. Pass None")
        geometry, next_id = previous.geometry, previous._next_id
        shift = np.rint((grid_map.geometry.corner - geometry.corner) / geometry.resolution)
        places = np.argwhere(previous.labels) + np.clip(shift, -(2**31), 2**31).astype(np.int64)
        on_map = ((places >= 0) & (places < labels.shape)).all(axis=1)
        old, new = previous.labels[previous.labels > 0][on_map], labels[tuple(places[on_map].T)]
        is_both = np.append(False, is_kept)[new]
        keys = old[is_both].astype(np.int64) * ids.size + new[is_both]
        pairs, shared = np.unique(keys, return_counts=True)
        claimed = set[int]()
        for pair in pairs[np.argsort(-shared, kind="stable")].tolist():
            number, label = divmod(pair, ids.size)
            if number not in claimed:
                claimed.add(number)
                ids[label] = ids[label] or number
    fresh = np.flatnonzero(is_kept & (ids[1:] == 0)) + 1
    ids[fresh] = next_id + np.arange(fresh.size)
    return ids[1:], next_id + fresh.size
