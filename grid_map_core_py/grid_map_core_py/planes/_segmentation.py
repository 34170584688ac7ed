# SPDX-License-Identifier: BSD-3-Clause
"""Segmentation: connected planar cells are split until each segment lies on one plane."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ._fits import Fit, Numbers, fit_planes
from ._parameters import SlidingWindow
from ._windows import _CROSS, Image, LocalPlanes

_MOST_ROUNDS = 60
_DROPPED = 0.02  # share of cells off the plane that a component may lose without being split
_HYPOTHESES = 24  # local planes tried per component and round
_SCORED = 200  # cells per component that judge the hypotheses
_REFITS = 3  # a local plane is only precise nearby; each fit to its cells extends its reach
_PIECE = 0.25  # pieces of a plane smaller than this share of the largest piece are split off again


class Cells(NamedTuple):
    """Planar cells of an image, as arrays (N,); lengths in cells, heights in meters.

    Attributes:
        places: indices into the flat image.
        x, y: row and column on the map.
        z: heights; the filtered heights of outliers.
        steady: cells that are no outliers; only these are fitted.
        slopes: (2, N) slopes of the local plane.
    """

    places: NDArray[np.int64]
    x: Numbers
    y: Numbers
    z: Numbers
    steady: NDArray[np.bool_]
    slopes: Numbers

    def chosen(self, numbers: NDArray[np.int64]) -> Cells:
        parts: Any = self
        return Cells(*(part.take(numbers, axis=-1) for part in parts))

    def fit(self, groups: NDArray[Any], count: int, mask: NDArray[np.bool_]) -> Fit:
        chosen = np.flatnonzero(mask & self.steady)
        points = self.x.take(chosen), self.y.take(chosen), self.z.take(chosen)
        return fit_planes(groups.take(chosen), count, points)


def planar_cells(heights: Image, planes: LocalPlanes) -> Cells:
    """Return the planar cells of an image of heights [m]."""
    planar = planes.planar
    places = np.flatnonzero(planar)
    columns, rows = np.divmod(places, heights.shape[1])
    z = np.where(planes.outliers, planes.heights, heights)[planar]
    slopes = np.stack([slope[planar] for slope in planes.slopes])
    x, y, z = (values.astype(np.float64) for values in (rows, columns, z))
    return Cells(places, x, y, z, ~planes.outliers[planar], slopes)


class Splitter:
    """Splits connected planar cells into planes.

    Each round labels the connected components of the remaining cells and fits a plane to each. If
    all cells but a few are near the plane and similarly inclined, the component is done. Otherwise
    a RANSAC, whose hypotheses are local planes, finds the largest plane of the component; its cells
    are done, and the others remain for the next round.
    """

    def __init__(
        self, cells: Cells, shape: tuple[int, int], resolution: float, limits: SlidingWindow
    ) -> None:
        self.cells, self.shape = cells, shape
        self.least = max(limits.min_number_points_per_label, 4)
        self.distance = limits.global_plane_fit_distance_error_threshold
        angle = math.radians(limits.global_plane_fit_angle_error_threshold_degrees)
        self.cosine, self.resolution = math.cos(angle), resolution

    def split(self) -> NDArray[np.uint8]:
        """Return an image of round numbers, 0 for cells on no plane.

        Cells of one round are on the same plane if they are connected through their sides.
        """
        rounds = np.zeros(self.shape, np.uint8)
        cells = self.cells
        for number in range(1, _MOST_ROUNDS + 1):
            if not cells.places.size:
                break
            groups, count = self._components(cells.places)
            done, remaining = self._round(cells, groups, count)
            rounds.reshape(-1)[cells.places[done]] = number
            cells = cells.chosen(np.flatnonzero(remaining))
        return rounds

    def _round(self, cells: Cells, groups: Any, count: int) -> tuple[Any, Any]:
        """Return the masks of cells that are done and of cells that remain."""
        fit = cells.fit(groups, count, np.ones(groups.size, np.bool_))
        near = self._near(cells, groups, fit)
        sizes, hits = np.bincount(groups, minlength=count), np.bincount(groups, near, count)
        is_large = sizes >= self.least
        is_flat = hits >= (1.0 - _DROPPED) * sizes
        is_split = is_large & ~is_flat
        done = near & (is_large & is_flat)[groups]
        remaining = np.zeros(groups.size, np.bool_)
        if is_split.any():
            chosen = np.flatnonzero(is_split[groups])
            numbers = np.cumsum(is_split) - 1
            largest = self._largest_planes(
                cells.chosen(chosen), numbers[groups[chosen]], int(is_split.sum())
            )
            done[chosen[largest]] = True
            found = np.bincount(groups[chosen], largest, count) > 0
            remaining[chosen] = ~largest & found[groups[chosen]]
        return done, remaining

    def _largest_planes(self, cells: Cells, groups: Any, count: int) -> Any:
        """Return the mask of the cells on the largest plane of each component."""
        fit = self._best_hypotheses(cells, groups, count)
        near = self._inliers(cells, groups, fit)
        for _ in range(_REFITS):
            fit = cells.fit(groups, count, near)
            near = self._inliers(cells, groups, fit)
        near = self._near(cells, groups, fit)
        pieces, number = self._components(cells.places[near])
        sizes = np.bincount(pieces, minlength=number)
        largest = np.zeros(count, np.int64)
        np.maximum.at(largest, groups[near], sizes[pieces])
        large = np.maximum(_PIECE * largest[groups[near]], self.least)
        near[near] = sizes[pieces] >= large
        return near

    def _best_hypotheses(self, cells: Cells, groups: Any, count: int) -> Fit:
        """Return the local plane with the most inliers of each component."""
        # A random sample of each component, of which the first cells offer their local planes.
        sizes = np.bincount(groups, minlength=count)
        random = np.random.default_rng(0).random(groups.size)
        sample = np.flatnonzero(random * sizes[groups] < _SCORED)
        sample = sample[np.lexsort((random[sample], groups[sample]))]
        judges, of = cells.chosen(sample), groups[sample]
        first = np.searchsorted(of, np.arange(count))
        drawn = np.bincount(of, minlength=count)
        best, votes = first.copy(), np.full(count, -1.0)
        for number in range(min(_HYPOTHESES, int(drawn.max()))):
            offered = first + number % np.maximum(drawn, 1)
            inliers = self._inliers(judges, of, self._local(judges, offered))
            found = np.bincount(of, inliers, count)
            better = found > votes
            best[better], votes[better] = offered[better], found[better]
        return self._local(judges, best)

    @staticmethod
    def _local(cells: Cells, chosen: Any) -> Fit:
        """Return the local planes of the chosen cells."""
        chosen = np.minimum(chosen, cells.x.size - 1)
        centers = np.stack([cells.x[chosen], cells.y[chosen]], axis=1)
        nothing = np.empty(0)
        return Fit(nothing, centers, cells.z[chosen], cells.slopes[:, chosen].T, nothing, nothing)

    def _inliers(self, cells: Cells, groups: Any, fit: Fit) -> Any:
        """Return the mask of cells near the plane of their group and similarly inclined."""
        return self._close(cells, groups, fit) & self._parallel(cells, groups, fit)

    def _near(self, cells: Cells, groups: Any, fit: Fit) -> Any:
        """Return the mask of cells near the plane of their group that are, or touch, an inlier.

        The window of a cell at an edge includes cells beyond the edge, which tilt its local plane.
        """
        close = self._close(cells, groups, fit)
        image = np.zeros(self.shape, np.uint8)
        image.reshape(-1)[cells.places[close & self._parallel(cells, groups, fit)]] = 1
        grown = cv2.dilate(image, _CROSS)
        return close & grown.reshape(-1)[cells.places].view(np.bool_)

    def _close(self, cells: Cells, groups: Any, fit: Fit) -> Any:
        with np.errstate(invalid="ignore"):
            return np.abs(cells.z - fit.at(groups, cells.x, cells.y)) <= self.distance

    def _parallel(self, cells: Cells, groups: Any, fit: Fit) -> Any:
        a, b = cells.slopes / self.resolution
        c, d = fit.slopes.T / self.resolution
        norms = np.sqrt(1 + c**2 + d**2) * self.cosine
        return 1 + a * c[groups] + b * d[groups] >= norms[groups] * np.sqrt(1 + a**2 + b**2)

    def _components(self, places: NDArray[np.int64]) -> tuple[Any, int]:
        """Return the number of the component of each place, and the number of components."""
        image = np.zeros(self.shape, np.uint8)
        image.reshape(-1)[places] = 1
        count, labels = cv2.connectedComponents(image, connectivity=4, ltype=cv2.CV_32S)
        return labels.reshape(-1)[places] - 1, count - 1
