# SPDX-License-Identifier: BSD-3-Clause
"""Segmentation: connected planar cells are split until each segment lies on one plane."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Mask
from ._parameters import SlidingWindow
from ._windows import CROSS, Cells, Image, Numbers

Groups = NDArray[Any]

_MOST_ROUNDS = 60
_DROPPED = 0.02  # share of cells off the plane that a component may lose without being split
_HYPOTHESES = 24  # local planes tried per component and round
_SCORED = 200  # cells per component that judge the hypotheses
_REFITS = 3  # a local plane is only precise nearby; each fit to its cells extends its reach


class Planes(NamedTuple):
    """Planes of G groups of cells: (G, 3) a point on each, and (G, 2) its dz/dx and dz/dy."""

    centers: Numbers
    slopes: Numbers

    def at(self, groups: Groups, points: Numbers) -> Numbers:
        """Return the heights (N,) of the planes of `groups` (N,) at points (3, N)."""
        a, b = self.slopes.T
        offsets = self.centers[:, 2] - (self.slopes * self.centers[:, :2]).sum(axis=1)
        return np.asarray(a[groups] * points[0] + b[groups] * points[1] + offsets[groups])


def fit_planes(
    groups: Groups, count: int, points: Numbers, weights: Numbers | None = None
) -> tuple[Planes, Numbers]:
    """Fit a plane to each group of points: weighted least squares, all groups at once.

    Args:
        groups: (N,) group of each point, 0 to `count` - 1.
        points: (3, N) x, y, z.
        weights: (N,) positive weights; None means 1.

    Returns:
        planes: the planes, with centers at the mean positions; NaN if they are not unique.
        covariances: (count, 3, 3) of height at the center and slopes, for weights 1 / variance.
    """

    def sums(values: Numbers) -> Any:
        return np.bincount(groups, values, count)

    with np.errstate(invalid="ignore", divide="ignore"):
        centers = np.array([sums(values) for values in points]) / np.bincount(groups, None, count)
        x, y, z = points - centers.take(groups, axis=1)
        w = np.ones(groups.size) if weights is None else weights
        wx, wy = w * x, w * y
        right = np.array([sums(w * z), sums(wx * z), sums(wy * z)])
        sx, sy, sxy = sums(wx), sums(wy), sums(wx * y)
        rows = [[sums(w), sx, sy], [sx, sums(wx * x), sxy], [sy, sxy, sums(wy * y)]]
        normal = np.moveaxis(np.array(rows, np.float64), -1, 0)
        # Collinear cells define no plane.
        scale = normal.diagonal(axis1=1, axis2=2).prod(axis=1)
        normal[~(np.linalg.det(normal) > 1e-9 * scale)] = np.nan
    covariances: Any = np.linalg.inv(normal)
    solved = (covariances @ right.T[..., None])[..., 0]
    centers[2] += solved[:, 0]
    return Planes(centers.T, solved[:, 1:]), covariances


class Splitter:
    """Splits connected planar cells into planes.

    Each round labels the connected components of the remaining cells and fits a plane to each. If
    all cells but a few are near the plane and similarly inclined, the component is done. Otherwise
    a RANSAC, whose hypotheses are local planes, finds the largest plane of the component; its cells
    are done, and the others remain for the next round.
    """

    def __init__(self, shape: tuple[int, int], limits: SlidingWindow) -> None:
        self.shape = shape
        self.least = max(limits.min_number_points_per_label, 4)
        self.distance = limits.global_plane_fit_distance_error_threshold
        self.cosine = math.cos(math.radians(limits.global_plane_fit_angle_error_threshold_degrees))

    def split(self, cells: Cells) -> Image:
        """Return an image of round numbers, 0 for cells on no plane.

        Cells of one round are on the same plane if they are connected through their sides.
        """
        rounds = np.zeros(self.shape, np.uint8)
        for number in range(1, _MOST_ROUNDS + 1):
            if not cells.places.size:
                break
            groups, count = self._components(cells.places)
            near = self._near(cells, groups, self._fit(cells, groups, count, True))
            sizes = np.bincount(groups, minlength=count)
            is_large = sizes >= self.least
            is_flat = np.bincount(groups, near, count) >= (1 - _DROPPED) * sizes
            rounds.reshape(-1)[cells.places[near & (is_large & is_flat)[groups]]] = number
            is_split = is_large & ~is_flat
            cells = cells.take(np.flatnonzero(is_split[groups]))
            groups = (np.cumsum(is_split) - 1)[groups[is_split[groups]]]
            near = self._largest_planes(cells, groups, int(is_split.sum()))
            rounds.reshape(-1)[cells.places[near]] = number
            has_plane = np.bincount(groups, near) > 0
            cells = cells.take(np.flatnonzero(~near & has_plane[groups]))
        return rounds

    def _largest_planes(self, cells: Cells, groups: Groups, count: int) -> Mask:
        """Return the mask of the cells on the largest plane of each component."""
        if not count:
            return np.zeros(0, np.bool_)
        planes = self._best_hypotheses(cells, groups, count)
        for _ in range(_REFITS):
            inliers = self._inliers(cells, groups, planes)
            planes = self._fit(cells, groups, count, inliers)
        near = self._near(cells, groups, planes)
        pieces, _ = self._components(cells.places[near])
        near[near] = np.bincount(pieces)[pieces] >= self.least
        return near

    @staticmethod
    def _fit(cells: Cells, groups: Groups, count: int, mask: Mask | bool) -> Planes:
        chosen = np.flatnonzero(cells.is_exact & mask)
        return fit_planes(groups.take(chosen), count, cells.points.take(chosen, axis=1))[0]

    def _best_hypotheses(self, cells: Cells, groups: Groups, count: int) -> Planes:
        """Return the local plane with the most inliers of each component."""
        # A random sample of each component, of which the first cells offer their local planes.
        random = np.random.default_rng(0).random(groups.size)
        sample = np.flatnonzero(random * np.bincount(groups)[groups] < _SCORED)
        sample = sample[np.lexsort((random[sample], groups[sample]))]
        judges, groups = cells.take(sample), groups[sample]
        local = Planes(judges.points.T, judges.slopes.T)
        first, drawn = np.searchsorted(groups, np.arange(count)), np.bincount(groups)
        best, votes = first.copy(), np.zeros(count)
        for number in range(min(_HYPOTHESES, int(drawn.max()))):
            offered = first + number % drawn
            planes = Planes(*(values[offered] for values in local))
            found = np.bincount(groups, self._inliers(judges, groups, planes), count)
            best = np.where(found > votes, offered, best)
            votes = np.maximum(found, votes)
        return Planes(*(values[best] for values in local))

    def _inliers(self, cells: Cells, groups: Groups, planes: Planes) -> Mask:
        """Return the mask of cells near the plane of their group and similarly inclined."""
        a, b = cells.slopes
        c, d = planes.slopes.T
        norms = self.cosine * np.sqrt(1 + c**2 + d**2)
        is_parallel = 1 + a * c[groups] + b * d[groups] >= norms[groups] * np.sqrt(1 + a**2 + b**2)
        return np.asarray(is_parallel & self._close(cells, groups, planes))

    def _near(self, cells: Cells, groups: Groups, planes: Planes) -> Mask:
        """Return the mask of cells near the plane of their group that are, or touch, an inlier.

        The window of a cell at an edge includes cells beyond the edge, which tilt its local plane.
        """
        image = np.zeros(self.shape, np.uint8)
        image.reshape(-1)[cells.places] = self._inliers(cells, groups, planes)
        touched = cv2.dilate(image, CROSS).reshape(-1)[cells.places].view(np.bool_)
        return touched & self._close(cells, groups, planes)

    def _close(self, cells: Cells, groups: Groups, planes: Planes) -> Mask:
        return np.asarray(
            np.abs(cells.points[2] - planes.at(groups, cells.points)) <= self.distance
        )

    def _components(self, places: NDArray[np.int64]) -> tuple[Groups, int]:
        """Return the number of the component of each place, and the number of components."""
        image = np.zeros(self.shape, np.uint8)
        image.reshape(-1)[places] = 1
        count, labels = cv2.connectedComponents(image, connectivity=4, ltype=cv2.CV_32S)
        return labels.reshape(-1)[places] - 1, count - 1
