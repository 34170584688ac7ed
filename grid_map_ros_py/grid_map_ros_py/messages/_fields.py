# SPDX-License-Identifier: BSD-3-Clause
"""Conversions and checks of message fields; failed checks raise `MessageError`."""

import math
import operator
import sys
from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GeometryError, GridGeometry, GridMap
from grid_map_core_py._arrays import as_array
from grid_map_core_py._arrays._checks import is_name
from grid_map_core_py.files._shared import say_crs_is_lost
from grid_map_core_py.limits import check_cells

from ..errors import MessageError
from ._packages import messages_of

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time
    from geometry_msgs.msg import Point, Pose, Quaternion, Transform
    from scipy.spatial.transform import Rotation
    from std_msgs.msg import Header

Matrix: TypeAlias = npt.NDArray[np.float64]
"""(4, 4) homogeneous transform: rotation and translation [m]."""

NORM_TOLERANCE = 1e-2
"""Maximum deviation of a quaternion norm from 1; rounding errors are much smaller."""

NANOSECONDS = 1_000_000_000
LATEST = (2**31 - 1) * NANOSECONDS + NANOSECONDS - 1
"""Latest time that a message can represent [ns]; its seconds are int32."""

ROTATION_TOLERANCE = 1e-6
"""Largest ratio of |x|, |y| or |z| to |w| at which a quaternion counts as unrotated."""


# --- times ----------------------------------------------------------------------------------------


def to_stamp(nanoseconds: int) -> "Time":
    """Convert nanoseconds since the epoch to `builtin_interfaces/Time`."""
    seconds, rest = divmod(check_nanoseconds(nanoseconds), NANOSECONDS)
    return messages_of("builtin_interfaces").Time(sec=seconds, nanosec=rest)


def check_nanoseconds(nanoseconds: int) -> int:
    """Return the time as an int; raise `MessageError` if a message cannot store it."""
    try:
        exact = operator.index(nanoseconds)
    except TypeError:
        raise MessageError("stamp", "an integer number of nanoseconds", nanoseconds) from None
    if not 0 <= exact <= LATEST:
        raise MessageError("stamp", f"nanoseconds from 0 to {LATEST}", exact)
    return exact


def from_stamp(stamp: "Time", field: str = "header.stamp") -> int:
    """Return the time of a message in nanoseconds since the epoch."""
    if stamp.sec < 0:
        raise MessageError(f"{field}.sec", "no negative number", stamp.sec)
    if stamp.nanosec >= NANOSECONDS:
        raise MessageError(f"{field}.nanosec", f"0 to {NANOSECONDS - 1}", stamp.nanosec)
    return int(stamp.sec * NANOSECONDS + stamp.nanosec)


def to_header(grid_map: GridMap) -> "Header":
    """Return the message header of a map; warn if the map has a `crs`."""
    say_crs_is_lost(grid_map, "a message", stacklevel=4)
    return messages_of("std_msgs").Header(
        stamp=to_stamp(grid_map.timestamp), frame_id=grid_map.frame_id
    )


# --- checks ---------------------------------------------------------------------------------------


def check_fields(message: object, kind: str, *paths: str) -> None:
    """Raise `MessageError` if an attribute in `paths` is missing or the frame name is invalid."""
    try:
        operator.attrgetter(*paths)(message)
    except AttributeError:
        package = type(message).__module__.partition(".")[0]
        found = f"{package}.{type(message).__name__}"
        raise MessageError("message", f"a {kind}", found) from None
    frame_id = getattr(getattr(message, "header", None), "frame_id", "")
    if frame_id != "" and not is_name(frame_id):
        raise MessageError("header.frame_id", "a text without control characters", frame_id)


def check_unique(field: str, names: Iterable[str]) -> None:
    if repeated := sorted(name for name, times in Counter(names).items() if times > 1):
        raise MessageError(field, "every name once", repeated)


def check_positive(field: str, value: float) -> float:
    """Return `value`; raise `MessageError` unless it is positive, finite and not subnormal."""
    if not sys.float_info.min <= value < math.inf:
        raise MessageError(field, "a positive finite number", value)
    return value


def check_position(field: str, position: "Point") -> tuple[float, float]:
    """Return x and y of a position; raise `MessageError` unless x, y and z are finite."""
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
    """Return `rows` (N, k); raise `MessageError` if they contain a NaN or infinite value."""
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        index = int(np.argmin(finite))
        shown = rows if found is None else found
        raise MessageError(f"{field}[{index}]", expected, tuple(shown[index].tolist()))
    return rows


def check_unrotated(field: str, orientation: "Quaternion") -> None:
    """Raise `MessageError` if a grid is rotated; an all-zero quaternion means no rotation."""
    *axis, w = found = (orientation.x, orientation.y, orientation.z, orientation.w)
    rotated = max(map(abs, axis)) > ROTATION_TOLERANCE * abs(w)
    if rotated or not all(map(math.isfinite, found)):
        raise MessageError(field, "the identity (0.0, 0.0, 0.0, 1.0)", found)


def check_grid(field: str, info: Any, cells: tuple[str, str], values: int) -> GridGeometry:
    """Return the geometry of a grid message; raise `MessageError` if the grid is invalid.

    Args:
        field: path of `info` in the message.
        info: grid description; its origin is the corner with the smallest x and y.
        cells: attribute names of the cell counts along x and y.
        values: number of values in the message.
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


def float32_resolution(resolution: float) -> float:
    """Round a resolution to float32; raise `MessageError` if it is out of range."""
    with np.errstate(over="ignore"):
        held = float(np.float32(resolution))
    if not 0 < held < math.inf:
        raise MessageError("resolution", "a positive number that float32 can hold", resolution)
    return held


def as_written(value: float) -> float:
    """Convert a float32 to the float64 with the same shortest decimal form, such as 0.1."""
    with np.errstate(over="ignore"):
        return float(str(np.float32(value)))


# --- poses ----------------------------------------------------------------------------------------


def from_pose(message: Any) -> Matrix:
    """Convert a pose to a (4, 4) matrix that transforms points [m] to the frame of the message.

    Args:
        message: a `Pose`, or a message with a field `pose`, such as `PoseStamped`,
            `PoseWithCovarianceStamped` or `Odometry`.

    Raises:
        MessageError: a coordinate is not finite, or the quaternion norm is not 1 (within 1 %).
    """
    kind = "geometry_msgs/Pose, or one with a pose"
    return _from(message, "pose", kind, "position", "orientation")


def from_transform(message: Any) -> Matrix:
    """Convert a `Transform` or `TransformStamped` to a (4, 4) matrix.

    The matrix transforms points [m] from the child frame to the parent frame. See `from_pose` for
    the errors.
    """
    return _from(message, "transform", "geometry_msgs/Transform", "translation", "rotation")


def to_pose(matrix: npt.ArrayLike) -> "Pose":
    """Convert a (4, 4) matrix to a `geometry_msgs/Pose`.

    Raises:
        MessageError: the matrix is not a rotation combined with a translation.
    """
    return _filled(messages_of("geometry_msgs").Pose(), "position", "orientation", matrix)


def to_transform(matrix: npt.ArrayLike) -> "Transform":
    """Convert a (4, 4) matrix to a `geometry_msgs/Transform`; see `to_pose` for the errors."""
    return _filled(messages_of("geometry_msgs").Transform(), "translation", "rotation", matrix)


def as_matrix(rotation: "Rotation", translation: npt.ArrayLike) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix()
    matrix[:3, 3] = translation
    return matrix


def _from(message: Any, inner: str, kind: str, place: str, turn: str) -> Matrix:
    """Return the matrix (4, 4) of a pose or transform, which may be nested in fields `inner`."""
    from scipy.spatial.transform import Rotation  # slow to import

    path = ""
    while hasattr(message, inner):
        message, path = getattr(message, inner), f"{path}{inner}."
    check_fields(message, kind, place, turn)
    position, orientation = getattr(message, place), getattr(message, turn)
    check_position(f"{path}{place}", position)
    quaternion = (orientation.x, orientation.y, orientation.z, orientation.w)
    if not abs(math.hypot(*quaternion) - 1.0) <= NORM_TOLERANCE:
        raise MessageError(f"{path}{turn}", "a quaternion of norm 1", quaternion)
    return as_matrix(Rotation.from_quat(quaternion), (position.x, position.y, position.z))


def _filled(message: Any, place: str, turn: str, matrix: npt.ArrayLike) -> Any:
    from scipy.spatial.transform import Rotation  # slow to import

    values = as_array(matrix, np.float64, "matrix")
    if values.shape != (4, 4) or not np.isfinite(values).all():
        raise MessageError("matrix", "4 x 4 finite numbers", matrix)
    turned = values[:3, :3]
    is_rotation = np.allclose(turned @ turned.T, np.eye(3), atol=NORM_TOLERANCE)
    if not (is_rotation and np.linalg.det(turned) > 0 and (values[3] == (0, 0, 0, 1)).all()):
        raise MessageError("matrix", "a rotation and a translation over (0, 0, 0, 1)", matrix)
    position, orientation = getattr(message, place), getattr(message, turn)
    position.x, position.y, position.z = values[:3, 3].tolist()
    quaternion = Rotation.from_matrix(turned).as_quat().tolist()
    orientation.x, orientation.y, orientation.z, orientation.w = quaternion
    return message
