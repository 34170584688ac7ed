# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Each contradiction in a map message raises one error that names the field."""

import array
import math
import pickle
from collections.abc import Callable
from typing import Any

import pytest
from geometry_msgs.msg import Quaternion
from std_msgs.msg import MultiArrayDimension
from test_grid_map import sample_map
from wire import set_field

from grid_map_core_py import GridMapError
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import MessageError, from_message, to_message

NAN, INF = math.nan, math.inf
Break = Callable[[Any], None]


def setting(path: str, value: Any) -> Break:
    return lambda message: set_field(message, path, value)


def floats(count: int) -> array.array:
    return array.array("f", [0.0] * count)


def swap_labels_only(message: GridMapMessage) -> None:
    for layer in message.data:
        first, second = layer.layout.dim
        first.label, second.label = second.label, first.label


# The message holds a map of 3 x 4 cells with the layers elevation (basic) and variance.
MALFORMED: dict[str, tuple[Break, str, str, str]] = {
    "fewer arrays than layers": (
        lambda m: m.data.pop(), "data", "2 arrays", "1"),
    "more arrays than layers": (
        lambda m: m.data.append(m.data[0]), "data", "2 arrays", "3"),
    "no layer names": (setting("layers", []), "data", "0 arrays", "2"),
    "a layer twice": (
        setting("layers", ["elevation"] * 2), "layers", "every name once", "['elevation']"),
    "a layer without name": (setting("layers", ["elevation", ""]), "layers[1]", "a name", "''"),
    "an unknown basic layer": (
        setting("basic_layers", ["slope"]), "basic_layers[0]", "one of ['elevation'", "'slope'"),
    **{
        f"dimensions {labels}": (
            lambda m, labels=labels: set_field(
                m, "data[0].layout.dim", [MultiArrayDimension(label=one) for one in labels]),
            "data[0].layout.dim",
            "the labels ('column_index', 'row_index'), or in reverse", repr(labels))
        for labels in [
            (), ("row_index",), ("column_index", "row_index", "row_index"), ("x", "row_index"),
            ("column_index", "y"), ("row_index", "row_index"), ("", "")]
    },
    "labels that contradict the sizes": (
        swap_labels_only, "data[0].layout.dim[0].size", "3 (row_index of 3 x 4 cells)", "4"),
    "too many columns": (
        setting("data[0].layout.dim[0].size", 5),
        "data[0].layout.dim[0].size", "4 (column_index of 3 x 4 cells)", "5"),
    "too few rows": (
        setting("data[1].layout.dim[1].size", 2),
        "data[1].layout.dim[1].size", "3 (row_index of 3 x 4 cells)", "2"),
    "no cells": (
        setting("data[0].layout.dim[0].size", 0),
        "data[0].layout.dim[0].size", "4 (column_index", "0"),
    "a length that is another number of cells": (
        setting("info.length_x", 2.0),
        "data[0].layout.dim[1].size", "4 (row_index of 4 x 4 cells)", "3"),
    "a resolution that is another number of cells": (
        setting("info.resolution", 0.25),
        "data[0].layout.dim[0].size", "8 (column_index of 6 x 8 cells)", "4"),
    "no data": (setting("data[0].data", floats(0)), "data[0].data", "12 values", "0"),
    "too little data": (setting("data[1].data", floats(11)), "data[1].data", "12 values", "11"),
    "too much data": (setting("data[0].data", floats(13)), "data[0].data", "12 values", "13"),
    "an offset that leaves too little data": (
        setting("data[0].layout.data_offset", 1),
        "data[0].data", "13 values (3 x 4 cells after data_offset 1)", "12"),
    "an offset beyond the data": (
        setting("data[0].layout.data_offset", 2**32 - 1),
        "data[0].data", "4294967307 values", "12"),
    "a size that would fill the memory": (
        lambda m: [
            setting("info.length_x", 1e9)(m), setting("data[0].layout.dim[1].size", 2**31)(m)],
        "data[0].layout.dim[1].size", "2000000000 (row_index", "2147483648"),
    "a size that would fill the memory and sizes that fit it": (
        lambda m: [
            setting("info.length_x", 1e9)(m), setting("data[0].layout.dim[1].size", 2 * 10**9)(m)],
        "data[0].data", "8000000000 values", "12"),
    "a size that no message holds": (
        setting("info.length_y", 1e300),
        "info.length_y", "1 to 2147483648 cells of 0.5 m", "1e+300"),
    "a size beyond all numbers": (
        lambda m: [setting("info.length_x", 1e300)(m), setting("info.resolution", 1e-300)(m)],
        "info.length_x", "1 to 2147483648 cells of 1e-300 m", "1e+300"),
    "a grid so small that numbers lose their digits": (
        lambda m: [
            setting(f"info.{name}", 5e-320)(m) for name in ("resolution", "length_x", "length_y")],
        "info.resolution", "a positive finite number", "5e-320"),
    "a length of less than half a cell": (
        setting("info.length_x", 0.2), "info.length_x", "1 to 2147483648 cells of 0.5 m", "0.2"),
    **{
        f"a {name} of {value}": (
            setting(f"info.{name}", value), f"info.{name}", "a positive finite number", repr(value))
        for name in ("resolution", "length_x", "length_y")
        for value in (0.0, -1.0, NAN, INF, -INF)
    },
    **{
        f"a position {axis} of {value}": (
            setting(f"info.pose.position.{axis}", value),
            f"info.pose.position.{axis}", "a finite number", repr(value))
        for axis in "xyz"
        for value in (NAN, INF)
    },
    **{
        f"an orientation of {xyzw}": (
            setting("info.pose.orientation", Quaternion(**dict(zip("xyzw", xyzw, strict=True)))),
            "info.pose.orientation", "the identity (0.0, 0.0, 0.0, 1.0)", repr(xyzw))
        for xyzw in [
            (0.0, 0.0, 0.7071, 0.7071),
            (1.0, 0.0, 0.0, 0.0),
            (0.0, NAN, 0.0, 1.0),
            (0.0, 0.0, 0.0, NAN),
            (0.0, 0.0, 0.0, INF),
        ]
    },
    "an outer start index outside the map": (
        setting("outer_start_index", 3), "outer_start_index", "0 to 2", "3"),
    "an inner start index outside the map": (
        setting("inner_start_index", 65535), "inner_start_index", "0 to 3", "65535"),
    "a time before the epoch": (
        setting("header.stamp.sec", -5), "header.stamp.sec", "no negative number", "-5"),
    "a full second of nanoseconds": (
        setting("header.stamp.nanosec", 10**9),
        "header.stamp.nanosec", "0 to 999999999", "1000000000"),
    "a time that no message could hold": (
        lambda m: [
            setting("header.stamp.sec", 2**31 - 1)(m),
            setting("header.stamp.nanosec", 2**32 - 1)(m)],
        "header.stamp.nanosec", "0 to 999999999", "4294967295"),
    "nothing set at all": (
        lambda m: m.__init__(), "info.resolution", "a positive finite number", "0.0"),
}  # fmt: skip


@pytest.mark.parametrize("unwrap", [True, False])
@pytest.mark.parametrize("kind", MALFORMED)
def test_malformed_message_gets_one_error_that_names_the_field(kind: str, unwrap: bool) -> None:
    spoil, field, expected, found = MALFORMED[kind]
    message = to_message(sample_map())
    spoil(message)
    with pytest.raises(MessageError) as error:
        from_message(message, unwrap=unwrap)
    text = str(error.value)
    path, _, rest = text.partition(": expected ")
    assert path == field or path.endswith(f", {field}")
    assert rest.startswith(expected)
    assert rest.endswith(f", got {found}")
    assert error.value.__cause__ is None
    assert error.value.__context__ is None


def test_all_layers_are_checked_even_if_not_requested() -> None:
    message = to_message(sample_map())
    message.data[1].data = floats(1)
    with pytest.raises(MessageError, match=r"layer 'variance', data\[1\]\.data: expected 12"):
        from_message(message, ["elevation"])


def test_error_derives_from_grid_map_error() -> None:
    assert issubclass(MessageError, GridMapError)
    assert issubclass(MessageError, ValueError)


def test_error_can_be_sent_to_another_process() -> None:
    error = pickle.loads(pickle.dumps(MessageError("data", "2 arrays", 3)))
    assert str(error) == "data: expected 2 arrays, got 3"
