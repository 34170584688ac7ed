# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Rows and columns of a submap."""

from __future__ import annotations

from numpy.typing import ArrayLike

from ..arrays._checks import as_pair, as_text
from ..errors import GeometryError, OutOfMapError
from ._geometry import GridGeometry


def submap_block(
    geometry: GridGeometry, position: ArrayLike, length: ArrayLike
) -> tuple[slice, slice]:
    """Return the rows and columns of the cells that a rectangle overlaps, clipped to the map.

    Args:
        geometry: of the map.
        position: (2,) center of the rectangle [m].
        length: (2,) side lengths along x and y [m].

    Raises:
        OutOfMapError: the rectangle does not overlap the map.
        GeometryError: a length is negative, or a number is not finite.
    """
    center, sides = as_pair(position, "position"), as_pair(length, "length")
    if (sides < 0).any():
        raise GeometryError(f"length: expected no negative numbers, got {as_text(sides)}")
    rows, columns = geometry.box(center - 0.5 * sides, center + 0.5 * sides)
    if rows.start == rows.stop:
        raise OutOfMapError(
            f"the submap at {as_text(center)} of length {as_text(sides)} does not overlap the map: "
            f"{geometry.place}"
        )
    return rows, columns
