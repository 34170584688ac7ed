# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of labeled cells as simple polygons with holes."""

from __future__ import annotations

from typing import NamedTuple

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
    a, b, c, d = image[:-1, :-1], image[:-1, 1:], image[1:, :-1], image[1:, 1:]  # views
    while True:
        blocks = np.zeros(image.shape, np.uint8)
        blocks[:-1, :-1] = (a == b) & (a == c) & (a == d)
        image *= cv2.dilate(blocks, np.ones((2, 2), np.uint8), anchor=(1, 1))
        falling = (a == d) & (a != b) & (a != c) & (a > 0)
        rising = (b == c) & (a != b) & (b != d) & (b > 0)
        if not (falling.any() or rising.any()):
            inner = slice(1 + margin, -1 - margin)
            return np.ascontiguousarray(image[inner, inner])
        a[falling] = 0
        b[rising] = 0


def masks(rounds: Image) -> list[Image]:
    """Return the mask of each positive number of an image."""
    numbers = np.flatnonzero(np.bincount(rounds.reshape(-1))[1:]) + 1
    return [(rounds == number).view(np.uint8) for number in numbers]


def components(rounds: Image) -> tuple[NDArray[np.int32], int]:
    """Label the connected components of each number in an image; return labels and their count."""
    labels = np.zeros(rounds.shape, np.int32)
    count = 0
    for mask in masks(rounds):
        found, own = cv2.connectedComponents(mask, connectivity=4, ltype=cv2.CV_32S)
        np.add(own, count, out=labels, where=own > 0)
        count += found - 1
    return labels, count


class Outlines(NamedTuple):
    """Edges of the outlines of R regions: for each region, the outer outline, then the holes.

    Attributes:
        edges: (4, P) x, y of the start and x, y of the end of each edge [m].
        starts: (C + 1,) index of the first edge of each outline, and P.
        first: (R + 1,) index of the first outline of each region, and C.
        areas: (R,) areas of the regions without the holes [m^2].
    """

    edges: Positions
    starts: NDArray[np.int64]
    first: NDArray[np.int64]
    areas: Positions


def outlines(
    labels: Image, rounds: Image, axes: tuple[Positions, Positions], resolution: float
) -> Outlines:
    """Trace the outlines of labels 1 to R; outer ones run counter-clockwise, holes clockwise.

    Args:
        labels: image of labels, each a connected component of a number in `rounds`.
        rounds: image of numbers, for which touching components differ.
        axes: x of each row and y of each column of the map [m].
        resolution: side of a cell [m].
    """
    contours: list[Image] = []
    is_hole = [np.zeros(0, np.bool_)]
    for mask in masks(np.where(labels > 0, rounds, np.uint8(0))):
        traced, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
        contours += [contour[::-1, 0] for contour in traced]  # pixels: row, column of the map
        is_hole.append(tree[0, :, 3] >= 0)
    corners = np.array([contour[0] for contour in contours], np.int64).reshape(-1, 2)
    owners = labels[corners[:, 1], corners[:, 0]]
    order = np.lexsort((np.concatenate(is_hole), owners))
    pixels = np.concatenate([np.empty((0, 2), np.int32), *(contours[i] for i in order)])
    starts = np.cumsum([0] + [len(contours[i]) for i in order])
    after = np.arange(1, len(pixels) + 1)
    after[starts[1:] - 1] = starts[:-1]
    ends = pixels[after]
    first = np.searchsorted(owners[order], np.arange(1, labels.max(initial=0) + 2))
    doubled = pixels[:, 0] * ends[:, 1] - pixels[:, 1] * ends[:, 0]
    areas = np.add.reduceat(doubled, starts[first[:-1]]) * (0.5 * resolution**2)
    x, y = axes
    edges = np.stack([x[pixels[:, 0]], y[pixels[:, 1]], x[ends[:, 0]], y[ends[:, 1]]])
    return Outlines(edges, starts, first, areas)
