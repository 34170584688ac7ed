# SPDX-License-Identifier: BSD-3-Clause
"""Checks of message fields; each raises one `MessageError` that names the field."""

import math
import sys
from collections import Counter
from collections.abc import Iterable
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GeometryError, GridGeometry
from grid_map_core_py.limits import check_cells
from grid_map_core_py.map import is_name

from ..errors import MessageError

if TYPE_CHECKING:
    from geometry_msgs.msg import Point, Quaternion

ROTATION_TOLERANCE = 1e-6
"""Largest x, y or z of a quaternion, relative to w, that counts as no rotation."""


def check_fields(message: object, kind: str, *paths: str) -> None:
    """Raise if an object is no message of a kind, which has `paths`, or its frame is invalid."""
    try:
        attrgetter(*paths)(message)
    except AttributeError:
        package = type(message).__module__.partition(".")[0]
        found = f"{package}.{type(message).__name__}"
        raise MessageError("message", f"a {kind}", found) from None
    frame_id = getattr(getattr(message, "header", None), "frame_id", "")
    if frame_id != "" and not is_name(frame_id):
        raise MessageError("header.frame_id", "a text without control characters", frame_id)


def check_unique(field: str, names: Iterable[str]) -> None:
    """Raise if a name comes twice."""
    if repeated := sorted(name for name, times in Counter(names).items() if times > 1):
        raise MessageError(field, "every name once", repeated)


def check_positive(field: str, value: float) -> float:
    """Return `value` if it is positive, finite and not subnormal."""
    if not sys.float_info.min <= value < math.inf:
        raise MessageError(field, "a positive finite number", value)
    return value


def check_position(field: str, position: "Point") -> tuple[float, float]:
    """Return x and y of a position whose coordinates are all finite."""
    for axis in ("x", "y", "z"):
        if not math.isfinite(value := getattr(position, axis)):
            raise MessageError(f"{field}.{axis}", "a finite number", value)
    return position.x, position.y


def check_finite(
    field: str,
    rows: npt.NDArray[np.floating[Any]],
    expected: str = "finite coordinates",
    found: npt.NDArray[np.float64] | None = None,
) -> Any:
    """Return (N, k) rows if all are finite; the error shows the row of `found`, else of `rows`."""
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        index = int(np.argmin(finite))
        shown = rows if found is None else found
        raise MessageError(f"{field}[{index}]", expected, tuple(shown[index].tolist()))
    return rows


def check_unrotated(field: str, orientation: "Quaternion") -> None:
    """Raise if a grid is rotated; the rows of a map run along x.

    Zeros count as unrotated: publishers that never set the orientation send them.
    """
    *axis, w = found = (orientation.x, orientation.y, orientation.z, orientation.w)
    rotated = max(map(abs, axis)) > ROTATION_TOLERANCE * abs(w)
    if rotated or not all(map(math.isfinite, found)):
        raise MessageError(field, "the identity (0.0, 0.0, 0.0, 1.0)", found)


def check_grid(field: str, info: Any, cells: tuple[str, str], values: int) -> GridGeometry:
    """Return the grid of a message whose cells begin at the smallest x and y.

    Args:
        field: path of `info`.
        info: description of the grid: numbers of cells, `resolution` and `origin`.
        cells: names of the numbers of cells along x and y.
        values: number of values in the message, which must be the number of cells.
    """
    size = (getattr(info, cells[0]), getattr(info, cells[1]))
    for name, count in zip(cells, size, strict=True):
        if count < 1:
            raise MessageError(f"{field}.{name}", "at least one cell", count)
    resolution = as_written(check_positive(f"{field}.resolution", info.resolution))
    origin = check_position(f"{field}.origin.position", info.origin.position)
    check_unrotated(f"{field}.origin.orientation", info.origin.orientation)
    try:
        length = np.multiply(size, resolution)
        geometry = GridGeometry(length, resolution, origin + 0.5 * length)
    except GeometryError as error:
        raise MessageError(field, "a grid of finite size and place", str(error)) from error
    if values != math.prod(size):
        expected = f"{math.prod(size)} values ({size[0]} x {size[1]} cells)"
        raise MessageError("data", expected, values)
    check_cells(field, geometry.size)
    return geometry


def as_float32(field: str, value: float) -> float:
    """Return a positive number rounded to float32, whose range it must fit."""
    with np.errstate(over="ignore"):
        held = float(np.float32(value))
    if not 0 < held < math.inf:
        raise MessageError(field, "a positive number that float32 can hold", value)
    return held


def as_written(value: float) -> float:
    """Return the float64 with the same shortest decimal form as a float32, such as 0.1.

    Values outside the float32 range, which only unsent messages can hold, become 0 or infinity.
    """
    with np.errstate(over="ignore"):
        return float(str(np.float32(value)))
