# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of labeled cells as simple polygons with holes."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Positions
from ._windows import Image


def cleaned(rounds: Image, margin: int) -> Image:
    """Remove cells until the outline through the centers of the border cells is simple.

    Every remaining cell belongs to a block of 2 x 2 cells with the same number, and cells with the
    same number that touch at a corner are also connected through a side there.

    Args:
        rounds: image of numbers; 0 for no region.
        margin: number of border cells that are removed first.
    """
    image = np.pad(rounds, 1 + margin)
    if margin:
        box = np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)
        image[cv2.erode(image, box) != cv2.dilate(image, box)] = 0
    while True:
        a, b, c, d = image[:-1, :-1], image[:-1, 1:], image[1:, :-1], image[1:, 1:]
        blocks = np.zeros(image.shape, np.uint8)
        blocks[:-1, :-1] = (a == b) & (a == c) & (a == d)
        kept: Image = cv2.dilate(blocks, np.ones((2, 2), np.uint8), anchor=(1, 1))
        image *= kept
        # Blocks have changed `a` ... `d`, which are views.
        falling = (a == d) & (a != b) & (a != c) & (a > 0)
        rising = (b == c) & (a != b) & (b != d) & (b > 0)
        if not (falling.any() or rising.any()):
            inner = 1 + margin
            return np.ascontiguousarray(image[inner:-inner, inner:-inner])
        a[falling] = 0
        b[rising] = 0


def components(rounds: NDArray[np.uint8]) -> tuple[NDArray[np.int32], int]:
    """Label the connected components of each number in an image; return labels and their count."""
    labels = np.zeros(rounds.shape, np.int32)
    count = 0
    for number in np.flatnonzero(np.bincount(rounds.reshape(-1))):
        if number:
            mask = (rounds == number).view(np.uint8)
            found, own = cv2.connectedComponents(mask, connectivity=4, ltype=cv2.CV_32S)
            np.add(own, count, out=labels, where=own > 0)
            count += found - 1
    return labels, count


class Outlines(NamedTuple):
    """Outlines of R regions, concatenated: of each region, the outer one, then the holes.

    Attributes:
        points: (P, 2) x, y of all vertices [m].
        starts: (C + 1,) index of the first vertex of each outline, and P.
        owners: (C,) region of each outline, ascending.
        areas: (R,) areas of the regions without the holes [m^2].
    """

    points: Positions
    starts: NDArray[np.int64]
    owners: NDArray[np.int64]
    areas: Positions


def outlines(
    labels: Image, axes: tuple[Positions, Positions], rounds: Image, count: int
) -> Outlines:
    """Trace the outlines of labels 1 to `count`; outer ones run counter-clockwise, holes clockwise.

    Args:
        labels: image of labels, each a connected component of a number in `rounds`.
        axes: x of each row and y of each column of the map [m].
    """
    contours: list[Image] = []
    is_hole: list[Image] = []
    present = np.where(labels > 0, rounds, np.uint8(0))
    for number in np.flatnonzero(np.bincount(present.reshape(-1))):
        if number:
            mask = (present == number).view(np.uint8)
            traced, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
            contours += traced
            is_hole.append(tree[0, :, 3] >= 0)
    if not contours:
        empty = np.zeros(0, np.int64)
        return Outlines(np.empty((0, 2)), np.zeros(1, np.int64), empty, np.empty(0))
    holes = np.concatenate(is_hole)
    pixels = np.concatenate(contours).reshape(-1, 2)  # (column, row) of the image
    lengths = np.array([len(contour) for contour in contours])
    begins = np.cumsum(lengths) - lengths
    owners = labels[pixels[begins, 1], pixels[begins, 0]].astype(np.int64) - 1
    order = np.lexsort((holes, owners))
    points = np.stack([axes[0][pixels[:, 0]], axes[1][pixels[:, 1]]], axis=1)
    areas = _signed_areas(points, begins, lengths)
    steps = np.where((areas > 0) != holes, 1, -1)[order]
    begins, lengths = begins[order], lengths[order]
    first = np.where(steps > 0, begins, begins + lengths - 1)
    starts = np.concatenate([[0], np.cumsum(lengths)])
    numbers = np.arange(len(points)) - starts[:-1].repeat(lengths)
    points = points[first.repeat(lengths) + steps.repeat(lengths) * numbers]
    signed = np.where(holes, -np.abs(areas), np.abs(areas))
    totals: Any = np.bincount(owners, signed, count)
    return Outlines(points, starts, owners[order], totals)


def _signed_areas(points: Positions, begins: Any, lengths: Any) -> Positions:
    """Return the areas of the polygons, positive for counter-clockwise ones."""
    offset = points - points[begins].repeat(lengths, axis=0)
    after = np.roll(offset, -1, axis=0)
    after[begins + lengths - 1] = 0.0  # the first vertex of each polygon
    doubled = offset[:, 0] * after[:, 1] - offset[:, 1] * after[:, 0]
    return 0.5 * np.add.reduceat(doubled, begins)
