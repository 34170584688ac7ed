# SPDX-License-Identifier: BSD-3-Clause
"""Groups the cells of a height map into planes.

Images in this module are transposed layers (cols, rows) in C order.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Mask
from ._parameters import PlaneParameters, SlidingWindow

Image = NDArray[Any]
Groups = NDArray[np.int64]
Numbers = NDArray[np.float64]

_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
_MOST_ROUNDS = 60
_DROPPED = 0.02  # share of cells off the plane that a component may lose without being split
_HYPOTHESES = 24  # local planes tried per component and round
_SCORED = 200  # cells per component that judge the hypotheses
_REFITS = 3  # a local plane is only precise nearby; each fit to its cells extends its reach


class Cells(NamedTuple):
    """Planar cells, with positions relative to cell (0, 0) [m].

    Attributes:
        places: (N,) indices into the flat image.
        points: (3, N) positions x, y, z; the heights of outliers are median-filtered.
        slopes: (2, N) dz/dx and dz/dy of the plane in the window around each cell.
        is_exact: (N,) mask of cells that are not outliers; planes are fitted to these cells only.
    """

    places: NDArray[np.int64]
    points: Numbers
    slopes: Numbers
    is_exact: Mask

    def take(self, chosen: NDArray[Any]) -> Cells:
        parts: Any = self
        return Cells(*(values.take(chosen, axis=-1) for values in parts))


def planar_cells(
    heights: Image, resolution: float, parameters: PlaneParameters
) -> tuple[Cells, Mask]:
    """Return the cells whose surroundings are planar, and a mask of these cells."""
    limits, median = parameters.sliding_window_plane_extractor, parameters.preprocessing
    distance = limits.global_plane_fit_distance_error_threshold
    steepest = math.tan(math.radians(limits.local_plane_inclination_threshold_degrees))
    border = max(limits.kernel_size, median.kernelSize) // 2
    known = np.pad(np.isfinite(heights), border)
    near, behind = _continuation(known)
    with np.errstate(over="ignore", invalid="ignore"):
        raw = np.pad(heights, border)
        raw = 2 * raw.take(near) - raw.take(behind)
        smooth = raw.copy()
        for _ in range(median.numberOfRepeats):
            smooth = cv2.medianBlur(smooth, median.kernelSize)
            smooth = 2 * smooth.take(near) - smooth.take(behind)
        outliers = known & (np.abs(raw - smooth) > distance)
        # The median cuts off corners and thin walls: cells with two neighbors at their height.
        lowered = np.flatnonzero(outliers & (raw > smooth))
        around = np.add.outer((-raw.shape[1], 0, raw.shape[1]), (-1, 0, 1)).reshape(-1)
        windows = raw.reshape(-1)[lowered[:, None] + around]
        similar = np.abs(windows - windows[:, 4:5]) <= distance
        corners = np.unravel_index(lowered[similar.sum(axis=1) > 2], raw.shape)
        smooth[corners], outliers[corners] = raw[corners], False
        tilts, squares = _window_fits(smooth, limits.kernel_size, resolution)
        planar = known & (tilts[0] ** 2 + tilts[1] ** 2 <= steepest**2)
        planar &= squares <= limits.plane_patch_error_threshold**2
    # An outlier stays in a region only if the region surrounds it.
    planar &= ~outliers | cv2.erode(planar.view(np.uint8), np.ones((3, 3))).view(np.bool_)
    inner = (slice(border, -border),) * 2
    planar = np.ascontiguousarray(planar[inner])
    if limits.planarity_opening_filter:
        steps: Any = {"kernel": _CROSS, "iterations": limits.planarity_opening_filter}
        planar = cv2.morphologyEx(planar.view(np.uint8), cv2.MORPH_OPEN, **steps).view(np.bool_)
    places = np.flatnonzero(planar)
    columns, rows = np.divmod(places, heights.shape[1])
    z = np.where(outliers, smooth, raw)[inner][planar]
    points = np.array([-resolution * rows, -resolution * columns, z])
    slopes = np.array([slope[inner][planar] for slope in tilts])
    return Cells(places, points, slopes, ~outliers[inner][planar]), planar


def _continuation(known: Mask) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return flat indices of the two known cells from which each value is extrapolated.

    The extrapolated value is 2 * first value - second value. The first cell is the nearest known
    cell. The second cell is twice as far away in the same direction; if it is unknown, the first
    cell is used twice.
    """
    places, unknown = np.arange(known.size).reshape(known.shape), (~known).view(np.uint8)
    kind: Any = {"distanceType": cv2.DIST_L2, "maskSize": 5, "labelType": cv2.DIST_LABEL_PIXEL}
    # Known cells are numbered row by row, from 1 on; without known cells, all numbers are 0.
    numbers = cv2.distanceTransformWithLabels(unknown, **kind)[1]
    near = np.append(0, places[known])[numbers]
    behind = np.clip(2 * near - places, 0, known.size - 1)
    return near, np.where(known.reshape(-1)[behind], behind, near)


def _window_fits(heights: Image, size: int, resolution: float) -> tuple[list[Image], Image]:
    """Return dz/dx, dz/dy and mean squared deviation [m^2] of the plane in each window."""
    data, mean = heights.astype(np.float64), np.full(size, 1 / size)
    steps = resolution * (size // 2 - np.arange(size))  # rows and columns run to -x and -y
    spread = (steps**2).mean()
    # In a symmetric window, x, y and 1 are orthogonal, so each coefficient is a single sum.
    gradient = steps / (size * spread)
    kernels = (gradient, mean), (mean, gradient), (mean, mean)
    *slopes, means = (cv2.sepFilter2D(data, cv2.CV_64F, *pair) for pair in kernels)
    squares = cv2.sepFilter2D(data**2, cv2.CV_64F, mean, mean) - means**2
    return slopes, squares - spread * (slopes[0] ** 2 + slopes[1] ** 2)


def fit_planes(
    groups: Groups, count: int, points: Numbers, weights: Numbers | float = 1.0
) -> tuple[Numbers, Numbers, Numbers]:
    """Fit a plane to each group of points with weighted least squares.

    Args:
        groups: (N,) group of each point, 0 to `count` - 1.
        points: (3, N) x, y, z.
        weights: (N,) positive weights, or one weight for all points.

    Returns:
        planes: (3, count) dz/dx, dz/dy, and z at x = y = 0; NaN if a plane is not unique.
        centers: (3, count) point on each plane at the mean x, y.
        covariances: (count, 3, 3) covariances of the height at the center, dz/dx and dz/dy, for
            weights of 1 / variance.
    """

    def sums(values: Any) -> Any:
        return np.bincount(groups, values, count)

    with np.errstate(invalid="ignore", divide="ignore"):
        centers = np.array([sums(values) for values in points]) / sums(None)
        x, y, z = points - centers.take(groups, axis=1)
        w = np.broadcast_to(weights, groups.shape)
        wx, wy = w * x, w * y
        right = np.array([sums(w * z), sums(wx * z), sums(wy * z)])
        sx, sy, sxy = sums(wx), sums(wy), sums(wx * y)
        rows = [[sums(w), sx, sy], [sx, sums(wx * x), sxy], [sy, sxy, sums(wy * y)]]
        normal = np.moveaxis(np.array(rows, np.float64), -1, 0)
        # Collinear cells define no plane.
        scale = normal.diagonal(axis1=1, axis2=2).prod(axis=1)
        normal[~(np.linalg.det(normal) > 1e-9 * scale)] = np.nan
    covariances: Any = np.linalg.inv(normal)
    height, *slopes = (covariances @ right.T[..., None])[..., 0].T
    centers[2] += height
    origin = centers[2] - slopes[0] * centers[0] - slopes[1] * centers[1]
    return np.stack([*slopes, origin]), centers, covariances


def above_planes(points: Numbers, planes: Numbers, groups: Groups) -> Numbers:
    a, b, c = planes
    return np.asarray(points[2] - a[groups] * points[0] - b[groups] * points[1] - c[groups])


class Splitter:
    """Assigns planar cells to planes, in several rounds.

    Each round fits a plane to each connected component of the remaining cells. A component is done
    if nearly all of its cells fit this plane. Otherwise, RANSAC finds the largest plane in the
    component. The cells on this plane are done, and the other cells remain for the next round.
    """

    def __init__(self, shape: tuple[int, int], limits: SlidingWindow) -> None:
        self.shape = shape
        self.least = max(limits.min_number_points_per_label, 4)
        self.distance = limits.global_plane_fit_distance_error_threshold
        self.cosine = math.cos(math.radians(limits.global_plane_fit_angle_error_threshold_degrees))

    def split(self, cells: Cells) -> Image:
        """Return an image with the round that assigned each cell to a plane; 0 for no plane.

        Connected cells with the same round are on the same plane; corners do not connect cells.
        """
        rounds = np.zeros(self.shape, np.uint8)
        for number in range(1, _MOST_ROUNDS + 1):
            if not cells.places.size:
                break
            groups, sizes = self._components(cells.places)
            near = self._near(cells, groups, self._fit(cells, groups, True))
            is_large = sizes >= self.least
            is_split = is_large & (np.bincount(groups, near) < (1 - _DROPPED) * sizes)
            near &= (is_large & ~is_split)[groups]
            rest = np.flatnonzero(is_split[groups])
            if rest.size:
                numbers = np.cumsum(is_split) - 1
                near[rest] = self._largest_planes(cells.take(rest), numbers[groups[rest]])
            rounds.reshape(-1)[cells.places[near]] = number
            has_plane = np.bincount(groups, near) > 0
            cells = cells.take(np.flatnonzero(~near & (is_split & has_plane)[groups]))
        return rounds

    def _largest_planes(self, cells: Cells, groups: Groups) -> Mask:
        planes = self._best_hypotheses(cells, groups)
        for _ in range(_REFITS):
            planes = self._fit(cells, groups, self._judged(cells, groups, planes)[1])
        near = self._near(cells, groups, planes)
        pieces, sizes = self._components(cells.places[near])
        near[near] = (sizes >= self.least)[pieces]
        return near

    def _best_hypotheses(self, cells: Cells, groups: Groups) -> Numbers:
        """Return the window plane with the most inliers in each of C components, (3, C)."""
        # A random sample of each component, of which the first cells offer their local planes.
        random = np.random.default_rng(0).random(groups.size)
        sample = np.flatnonzero(random * np.bincount(groups)[groups] < _SCORED)
        sample = sample[np.lexsort((random[sample], groups[sample]))]
        judges, groups = cells.take(sample), groups[sample]
        (x, y, z), (a, b) = judges.points, judges.slopes
        local, drawn = np.stack([a, b, z - a * x - b * y]), np.bincount(groups)
        tried = np.arange(min(_HYPOTHESES, drawn.max()))[:, None] % drawn
        tried += np.cumsum(drawn) - drawn
        inliers = (self._judged(judges, groups, local[:, numbers])[1] for numbers in tried)
        votes = np.array([np.bincount(groups, mask) for mask in inliers])
        return local[:, tried[votes.argmax(axis=0), np.arange(drawn.size)]]

    @staticmethod
    def _fit(cells: Cells, groups: Groups, mask: Mask | bool) -> Numbers:
        chosen, count = np.flatnonzero(cells.is_exact & mask), groups.max() + 1
        return fit_planes(groups.take(chosen), count, cells.points.take(chosen, axis=1))[0]

    def _judged(self, cells: Cells, groups: Groups, planes: Numbers) -> tuple[Mask, Mask]:
        """Return two masks: cells near the plane of their group, and inliers.

        An inlier is near the plane and has a similar slope.
        """
        (a, b), (c, d, _) = cells.slopes, planes
        norms = self.cosine * np.sqrt(1 + c**2 + d**2)
        is_parallel = 1 + a * c[groups] + b * d[groups] >= norms[groups] * np.sqrt(1 + a**2 + b**2)
        is_close = np.abs(above_planes(cells.points, planes, groups)) <= self.distance
        return is_close, is_close & is_parallel

    def _near(self, cells: Cells, groups: Groups, planes: Numbers) -> Mask:
        """Return a mask of the cells near their plane that are inliers or beside an inlier."""
        # Windows at the edge of a surface reach beyond it, so their planes are tilted.
        image = np.zeros(self.shape, np.uint8)
        is_close, image.reshape(-1)[cells.places] = self._judged(cells, groups, planes)
        return is_close & cv2.dilate(image, _CROSS).reshape(-1)[cells.places].view(np.bool_)

    def _components(self, places: NDArray[np.int64]) -> tuple[Groups, NDArray[np.int64]]:
        """Return the component number (N,) of each cell, and the component sizes."""
        image = np.zeros(self.shape, np.uint8)
        image.reshape(-1)[places] = 1
        _, labels = cv2.connectedComponents(image, connectivity=4, ltype=cv2.CV_32S)
        groups = labels.reshape(-1)[places].astype(np.int64) - 1
        return groups, np.bincount(groups)
