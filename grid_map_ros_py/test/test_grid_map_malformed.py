# SPDX-License-Identifier: BSD-3-Clause
"""Each contradiction in a map message raises one error that names the field."""

import array
import copy
import math
from typing import Any

import pytest
from geometry_msgs.msg import Quaternion
from rclpy.serialization import serialize_message
from std_msgs.msg import MultiArrayDimension
from test_grid_map import sample_map
from wire import set_field

from grid_map_core_py.limits import changed_limits
from grid_map_msgs.msg import GridMap as GridMapMessage, GridMapInfo
from grid_map_ros_py import MessageError, from_message, from_serialized_message, to_message

NAN, INF = math.nan, math.inf
HUGE = 2**32 - 1
DIM = "data[0].layout.dim"
LABELS = "the labels ('column_index', 'row_index'), or in reverse"
POSITIVE = "a positive finite number"
TWO = to_message(sample_map()).data


def floats(count: int) -> array.array:
    return array.array("f", [0.0] * count)


def dims(*labels: str) -> list[MultiArrayDimension]:
    return [MultiArrayDimension(label=label) for label in labels]


# The message holds a map of 3 x 4 cells with the layers elevation (basic) and variance. Each entry
# has changes, and field, expectation and found value of the error.
MALFORMED: list[tuple[dict[str, Any], str, str, str]] = [
    ({"data": TWO[:1]}, "data", "2 arrays", "1"),
    ({"data": [*TWO, TWO[0]]}, "data", "2 arrays", "3"),
    ({"layers": []}, "data", "0 arrays", "2"),
    ({"layers": ["elevation"] * 2}, "layers", "every name once", "['elevation']"),
    ({"layers": ["elevation", ""]}, "layers[1]", "a name", "''"),
    ({"layers": ["\x7f", "slope"]}, "layers[0]", "a name without control", "'\\x7f'"),
    ({"header.frame_id": "\x1b[2J"}, "header.frame_id", "a text without control", "'\\x1b[2J'"),
    ({"basic_layers": ["slope"]}, "basic_layers[0]", "one of ['elevation'", "'slope'"),
    *(
        ({DIM: dims(*labels)}, DIM, LABELS, repr(labels))
        for labels in [
            (), ("column_index", "row_index", "row_index"), ("x", "row_index")]
    ),
    (
        {f"{DIM}[0].label": "row_index", f"{DIM}[1].label": "column_index"},
        f"{DIM}[0].size", "3 (row_index of 3 x 4 cells)", "4"),
    ({f"{DIM}[0].size": 5}, f"{DIM}[0].size", "4 (column_index of 3 x 4 cells)", "5"),
    ({f"{DIM}[0].stride": 7}, f"{DIM}[0].stride", "one of (0, 1, 4, 3, 12)", "7"),
    ({"info.length_x": 2.0}, f"{DIM}[1].size", "4 (row_index of 4 x 4 cells)", "3"),
    ({"info.resolution": 0.25}, f"{DIM}[0].size", "8 (column_index of 6 x 8 cells)", "4"),
    ({"data[0].data": floats(0)}, "data[0].data", "12 values", "0"),
    ({"data[0].data": floats(13)}, "data[0].data", "12 values", "13"),
    (
        {"data[0].layout.data_offset": 1},
        "data[0].data", "13 values (3 x 4 cells after data_offset 1)", "12"),
    ({"data[0].layout.data_offset": HUGE}, "data[0].data", "4294967307 values", "12"),
    (
        {"info.length_x": 1e9, f"{DIM}[1].size": 2**31},
        f"{DIM}[1].size", "2000000000 (row_index", "2147483648"),
    ({"info.length_x": 1e9, f"{DIM}[1].size": 2 * 10**9}, "data[0].data", "8000000000", "12"),
    ({"info.length_y": 1e300}, "info.length_y", "1 to 2147483648 cells of 0.5 m", "1e+300"),
    (
        {f"info.{name}": 5e-320 for name in ("resolution", "length_x", "length_y")},
        "info.resolution", POSITIVE, "5e-320"),
    ({"info.length_x": 0.2}, "info.length_x", "1 to 2147483648 cells of 0.5 m", "0.2"),
    *(
        ({f"info.{name}": value}, f"info.{name}", POSITIVE, repr(value))
        for name in ("resolution", "length_x", "length_y")
        for value in (0.0, -1.0, NAN, INF)
    ),
    *(
        ({path: value}, path, "a finite number", repr(value))
        for path in ("info.pose.position.x", "info.pose.position.y", "info.pose.position.z")
        for value in (NAN, INF)
    ),
    *(
        (
            {"info.pose.orientation": Quaternion(**dict(zip("xyzw", xyzw, strict=True)))},
            "info.pose.orientation", "the identity (0.0, 0.0, 0.0, 1.0)", repr(xyzw))
        for xyzw in [
            (0.0, 0.0, 0.7071, 0.7071), (0.0, NAN, 0.0, 1.0), (0.0, 0.0, 0.0, INF)]
    ),
    ({"outer_start_index": 3}, "outer_start_index", "0 to 2", "3"),
    ({"inner_start_index": 65535}, "inner_start_index", "0 to 3", "65535"),
    ({"header.stamp.sec": -5}, "header.stamp.sec", "no negative number", "-5"),
    (
        {"header.stamp.nanosec": 10**9},
        "header.stamp.nanosec", "0 to 999999999", "1000000000"),
    ({"info": GridMapInfo()}, "info.resolution", POSITIVE, "0.0"),
]  # fmt: skip

malformed = pytest.mark.parametrize(("changes", "field", "expected", "found"), MALFORMED)


def spoilt(changes: dict[str, Any]) -> GridMapMessage:
    message = copy.deepcopy(to_message(sample_map()))
    for path, value in changes.items():
        set_field(message, path, value)
    return message


@malformed
def test_malformed_message_gets_one_error_that_names_the_field(
    changes: dict[str, Any], field: str, expected: str, found: str
) -> None:
    message = spoilt(changes)
    with changed_limits(max_cells=2**62), pytest.raises(MessageError) as error:
        from_message(message)
    text = str(error.value)
    path, _, rest = text.partition(": expected ")
    assert path == field or path.endswith(f", {field}")
    assert rest.startswith(expected)
    assert rest.endswith(f", got {found}")
    assert error.value.__cause__ is None
    assert error.value.__context__ is None
    with changed_limits(max_cells=2**62), pytest.raises(MessageError) as error:
        from_serialized_message(serialize_message(message), unwrap=False)
    assert str(error.value) == text


def test_all_layers_are_checked_even_if_not_requested() -> None:
    message = to_message(sample_map())
    message.data[1].data = floats(1)
    with pytest.raises(MessageError, match=r"layer 'variance', data\[1\]\.data: expected 12"):
        from_message(message, ["elevation"])
