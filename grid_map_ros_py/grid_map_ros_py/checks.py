# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Checks that several messages share: each raises one `MessageError` that names the field."""

import math

from geometry_msgs.msg import Point, Quaternion

from .errors import MessageError

ROTATION_TOLERANCE = 1e-6
"""Largest component of a rotation axis, relative to w, that still counts as no rotation."""


def check_positive(field: str, value: float) -> float:
    """Return `value` if it is a positive finite number."""
    if not (math.isfinite(value) and value > 0):
        raise MessageError(field, "a positive finite number", value)
    return value


def check_position(field: str, position: Point) -> tuple[float, float]:
    """Return x and y of a position whose coordinates are all finite."""
    for axis in ("x", "y", "z"):
        if not math.isfinite(value := getattr(position, axis)):
            raise MessageError(f"{field}.{axis}", "a finite number", value)
    return position.x, position.y


def check_unrotated(field: str, orientation: Quaternion) -> None:
    """Refuse a rotated grid, which a map whose rows run along x cannot hold.

    All zeros count as unrotated: publishers that never set the orientation send them.
    """
    *axis, w = found = (orientation.x, orientation.y, orientation.z, orientation.w)
    rotated = max(map(abs, axis)) > ROTATION_TOLERANCE * abs(w)
    if rotated or not all(map(math.isfinite, found)):
        raise MessageError(field, "the identity (0.0, 0.0, 0.0, 1.0)", found)
