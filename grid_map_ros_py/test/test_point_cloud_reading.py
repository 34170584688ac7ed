# SPDX-License-Identifier: BSD-3-Clause
"""Point clouds of every layout as arrays and maps."""

import array
import math
import struct
from typing import Any

import numpy as np
import pytest
from clouds import CODES, FLOAT32, FLOAT64, UINT8, UINT32, packed_cloud, xyz_cloud, xyz_fields
from cpp_recordings import recorded
from hypothesis import assume, given, settings, strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2, PointField
from wire import set_field

from conftest import peak_memory
from grid_map_core_py import GridGeometry, GridMap, GridMapError
from grid_map_core_py.testing import assert_maps_equal, grid_maps, moved_in_buffer
from grid_map_ros_py import (
    MessageError,
    from_message,
    from_point_cloud,
    read_points,
    to_message,
    to_point_cloud,
)
from grid_map_ros_py.messages._point_cloud import read_columns

NAN = math.nan


# --- arrays ---------------------------------------------------------------------------------------


def numbers(datatype: int) -> st.SearchStrategy[Any]:
    if CODES[datatype] in "fd":
        return st.floats(width=32 if datatype == FLOAT32 else 64)
    bits = 8 * struct.calcsize(CODES[datatype])
    low = 0 if CODES[datatype].isupper() else -(2 ** (bits - 1))
    return st.integers(low, low + 2**bits - 1)


@st.composite
def layouts(draw: st.DrawFn) -> dict[str, Any]:
    """Draw fields in any order, with gaps before, between and behind them, and rows of points."""
    names = draw(st.lists(st.sampled_from("abcdxyz"), unique=True, min_size=1))
    fields, end = [], 0
    for name in names:
        datatype, count = draw(st.sampled_from([*CODES])), draw(st.integers(0, 3))
        offset = end + draw(st.integers(0, 5))
        fields.append((name, offset, datatype, count))
        end = offset + max(count, 1) * struct.calcsize(CODES[datatype])
    return {
        "fields": draw(st.permutations(fields)),
        "point_step": end + draw(st.integers(0, 5)),
        "height": draw(st.integers(1, 3)),
        "row_padding": draw(st.integers(0, 5)),
    }


@settings(max_examples=60)
@given(layouts(), st.integers(0, 3), st.data())
def test_points_of_any_layout_are_read(
    layout: dict[str, Any], width: int, data: st.DataObject
) -> None:
    points = []
    for _ in range(width * layout["height"]):
        point: dict[str, Any] = {}
        for name, _, datatype, count in layout["fields"]:
            values = [data.draw(numbers(datatype)) for _ in range(max(count, 1))]
            point[name] = values if count > 1 else values[0]
        points.append(point)
    sent = packed_cloud(points, **layout)
    arrays = read_points(deserialize_message(serialize_message(sent), PointCloud2))
    assert [*arrays] == [name for name, *_ in layout["fields"]]
    for name, _, datatype, count in layout["fields"]:
        expected_shape = (len(points), count) if count > 1 else (len(points),)
        assert arrays[name].shape == expected_shape
        assert arrays[name].dtype.char == np.dtype(CODES[datatype]).char
        np.testing.assert_array_equal(
            arrays[name], np.array([point[name] for point in points]).reshape(expected_shape)
        )


def test_organized_cloud_is_read_row_after_row() -> None:
    points = [{"x": k, "y": -k, "z": 0.5 * k} for k in range(6)]
    plain, padded = (
        packed_cloud(points, xyz_fields(), height=2, row_padding=padding) for padding in (0, 7)
    )
    for cloud in (plain, padded):
        assert read_points(cloud)["x"].reshape(2, 3).tolist() == [[0, 1, 2], [3, 4, 5]]
        np.testing.assert_array_equal(read_columns(cloud)[0][:, 2], 0.5 * np.arange(6))
    for values in (*read_points(plain).values(), read_columns(plain)[0]):
        assert np.shares_memory(values, np.frombuffer(plain.data, np.uint8))


# --- maps -----------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(grid_maps(layers=("elevation", "variance")))
def test_map_round_trips_through_a_cloud(grid_map: GridMap) -> None:
    # Coordinates in the cloud are float32: if cells are too small, points fall into wrong cells.
    reach = np.float32(np.max(np.abs(grid_map.position) + grid_map.length))
    assume(np.spacing(reach) < 0.1 * grid_map.resolution)
    result = from_point_cloud(to_point_cloud(grid_map, "elevation"), onto=grid_map.geometry)
    is_point = grid_map.valid_mask(("elevation", *grid_map.basic_layers))
    expected = grid_map.without_layers(["variance"]).copy()
    expected.basic_layers = ()
    expected["elevation"][~is_point] = np.nan
    assert_maps_equal(result.without_layers(["variance"]), expected)


def test_moved_map_round_trips_onto_itself() -> None:
    values = np.random.default_rng(3).random((5, 4), np.float32)
    world = GridMap((0.5, 0.4), 0.1, (7.0, -3.0), {"elevation": values, "other": 1.0})
    moved = moved_in_buffer(world, (3, 2))
    cloud = to_point_cloud(moved, "elevation", ["elevation"])
    result = from_point_cloud(cloud, onto=moved)
    assert result.start_index == (3, 2)
    assert np.shares_memory(result._layers["other"], moved["other"])
    assert_maps_equal(result, world)


def test_cloud_of_the_cpp_demo_gives_its_map() -> None:
    (published,) = recorded("cpp_tutorial", "elevation_points", PointCloud2)
    (original,) = recorded("cpp_tutorial", "grid_map", type(to_message(GridMap((1, 1), 1.0))))
    expected = from_message(original.message)
    result = from_point_cloud(published.message, onto=expected.geometry)
    np.testing.assert_array_equal(result["elevation"], expected["elevation"])
    assert (result.frame_id, result.timestamp) == (expected.frame_id, expected.timestamp)
    assert "elevation_noisy" in result.layers


def test_map_without_position_fits_the_points() -> None:
    cloud = xyz_cloud([(0.0, 0.0, 1.0), (0.9, 1.9, 2.0), (0.9, 1.9, 3.0)])
    assert from_point_cloud(cloud, resolution=1.0, tight=True)["elevation"].tolist() == [[3.0, 1.0]]
    result = from_point_cloud(cloud, resolution=1.0)
    # The borders are at multiples of the resolution, and a point there belongs to the smaller cell.
    assert (result.size, result.position.tolist()) == ((2, 3), [0.0, 0.5])
    assert result.layers == ("elevation",)
    assert (result.frame_id, result.timestamp) == ("map", 7_000_000_000)
    low = from_point_cloud(cloud, resolution=1.0, length=(9, 9), position=(1, 1), max_height=1.5)
    assert (low.size, np.nansum(low["elevation"])) == ((9, 9), 1.0)
    lowest = from_point_cloud(cloud, "ground", 1.0, "min", more_layers={"n": "count"})
    assert lowest.layers == ("ground", "n")
    assert np.nanmax(lowest["ground"]) == 2.0
    assert lowest["n"].sum() == 3


@pytest.mark.parametrize("datatype", CODES)
def test_coordinates_may_have_any_type_and_order(datatype: int) -> None:
    size = struct.calcsize(CODES[datatype])
    fields = [("z", 0, datatype, 1), ("x", 3 + size, FLOAT64, 1), ("y", 11 + size, datatype, 0)]
    xyz, columns = read_columns(packed_cloud([{"x": 5e6 + 0.1, "y": 2, "z": 20}], fields))
    assert (xyz.dtype, xyz.tolist(), columns) == (np.float64, [[5e6 + 0.1, 2.0, 20.0]], {})
    points = [{"x": 1, "y": 2, "z": 3}, {"x": 3, "y": 2, "z": 9}]
    result = from_point_cloud(packed_cloud(points, xyz_fields(datatype)), resolution=2.0)
    assert result["elevation"].tolist() == [[9.0], [3.0]]


def test_empty_cloud_is_an_empty_map() -> None:
    empty = packed_cloud([], xyz_fields())
    result = from_point_cloud(empty, onto=GridGeometry(np.array([2.0, 1.0]), 1.0))
    assert np.isnan(result["elevation"]).all()
    with pytest.raises(GridMapError, match="points: expected a finite one"):
        from_point_cloud(empty, resolution=1.0)


# --- fields ---------------------------------------------------------------------------------------

FIELDS = [
    *xyz_fields(),
    ("intensity", 12, UINT8, 1),
    ("normal", 16, FLOAT32, 3),
    ("ring", 28, 4, 0),
]
POINTS = [
    {"x": 0, "y": 0, "z": 1, "intensity": 10, "normal": [0, 0, 1], "ring": 3},
    {"x": 0, "y": 0, "z": 2, "intensity": 40, "normal": [0, 1, 0], "ring": 4},
]


def test_other_fields_become_layers() -> None:
    cloud = packed_cloud(POINTS, FIELDS)
    result = from_point_cloud(cloud, resolution=1.0, field_reductions={"ring": "last"})
    found = {name: result[name].item() for name in result}
    assert found == {"elevation": 2.0, "intensity": 25.0, "ring": 4.0}
    assert from_point_cloud(cloud, resolution=1.0, fields=()).layers == ("elevation",)
    chosen = from_point_cloud(cloud, resolution=1.0, fields=["ring"])
    assert chosen.layers == ("elevation", "ring")
    assert from_point_cloud(cloud, resolution=1.0, fields="ring").layers == chosen.layers


@pytest.mark.parametrize("alpha", [0, 0xFE])
@pytest.mark.parametrize(
    ("name", "datatype"), [("rgb", FLOAT32), ("rgb", UINT32), ("rgba", UINT32)]
)
def test_colors_become_the_layer_color(name: str, datatype: int, alpha: int) -> None:
    bits = np.array([0x102030, 0x304050], np.uint32) | np.uint32(alpha << 24)
    values = bits.view(np.float32) if datatype == FLOAT32 else bits
    points = [{"x": 0, "y": 0, "z": 0, name: value} for value in values.tolist()]
    cloud = packed_cloud(points, [*xyz_fields(), (name, 16, datatype, 1)])
    mean = from_point_cloud(cloud, resolution=1.0)
    assert mean.layers == ("elevation", "color")
    assert hex(mean["color"].view(np.uint32).item()) == "0x203040"
    last = from_point_cloud(cloud, resolution=1.0, field_reductions={name: "last"})
    assert hex(last["color"].view(np.uint32).item()) == "0x304050"


# --- bad messages ---------------------------------------------------------------------------------


ANYWHERE = GridMap((1, 1), 1.0)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({}, "'resolution': expected a number, or `onto`"),
        *(
            ({"onto": ANYWHERE, **also}, "'onto': expected no resolution, length or position")
            for also in ({"resolution": 1.0}, {"length": (1, 1)}, {"position": (0, 0)})
        ),
        (
            {"onto": GridMap((1, 1), 1.0, frame_id="odom")},
            "header.frame_id: expected that of .*'odom'",
        ),
        ({"resolution": 1.0, "reduction": "highest"}, "reduction of elevation"),
        ({"fields": ["rings"]}, r"fields: expected one called 'rings', got \['x'"),
        ({"fields": ["normal"]}, r"fields\[4\]\.count: expected 1 for 'normal', got 3"),
        ({"fields": ["rgb"]}, r"fields\[6\]\.datatype: expected UINT32 or FLOAT32 for packed"),
    ],
)
def test_invalid_argument_is_named(options: dict[str, Any], text: str) -> None:
    cloud = packed_cloud([POINTS[0] | {"rgb": 9}], [*FIELDS, ("rgb", 30, 2, 1)])
    with pytest.raises(GridMapError, match=text):
        from_point_cloud(cloud, **{"fields": [], **options})
    assert from_point_cloud(cloud, fields=[], onto=ANYWHERE).frame_id == "map"


HUGE = 2**32 - 1


def sized(count: int) -> dict[str, Any]:
    return {"data": array.array("B", bytes(count))}


# The cloud has 2 rows of 3 points of 20 bytes: x, y, z, rgb and 4 bytes that are not used. Each
# entry has changes, and field, expectation and found value of the error.
MALFORMED: list[tuple[dict[str, Any], str, str, str]] = [
    ({"is_bigendian": True}, "is_bigendian", "little-endian", "True"),
    (sized(119), "data", "120 bytes (2 rows of 60)", "119"),
    ({"width": HUGE}, "row_step", f"at least {20 * HUGE} ({HUGE} points", "60"),
    ({"height": HUGE}, "data", f"({HUGE} rows of 60)", "120"),
    ({"width": HUGE, "height": HUGE, "row_step": HUGE}, "row_step", f"{HUGE} points", str(HUGE)),
    ({"row_step": 59}, "row_step", "at least 60", "59"),
    ({"row_step": HUGE}, "data", f"2 rows of {HUGE}", "120"),
    ({"point_step": 15}, "point_step", "at least 16, where field 'rgb' (fields[3])", "15"),
    ({"point_step": HUGE}, "row_step", f"3 points of {HUGE}", "60"),
    ({"fields[1].offset": 17}, "point_step", "at least 21, where field 'y' (fields", "20"),
    ({"fields[3].offset": HUGE}, "point_step", f"at least {HUGE + 4}", "20"),
    ({"fields[3].count": HUGE}, "point_step", f"at least {12 + 4 * HUGE}", "20"),
    ({"fields[2].datatype": 9}, "fields[2].datatype", "1 to 8", "9"),
    ({"fields[3].name": "x"}, "fields", "every name once", "['x']"),
    ({"fields[3].name": ""}, "fields[3].name", "a name", "''"),
    ({"header.stamp.sec": -1}, "header.stamp.sec", "no negative", "-1"),
    ({"fields[0].name": "a"}, "fields", "one called 'x'", "['a', 'y', 'z', 'rgb']"),
    ({"fields": []}, "fields", "one called 'x'", "[]"),
    ({"fields[0].count": 2}, "fields[0].count", "1 for 'x'", "2"),
]


def valid_cloud() -> PointCloud2:
    points = [{"x": k, "y": k, "z": k, "rgb": k} for k in range(6)]
    fields = [*xyz_fields(), ("rgb", 12, UINT32, 1)]
    return packed_cloud(points, fields, point_step=20, height=2)


@pytest.mark.parametrize(("changes", "field", "expected", "found"), MALFORMED)
def test_malformed_cloud_is_refused_without_taking_memory(
    changes: dict[str, Any], field: str, expected: str, found: str
) -> None:
    cloud = valid_cloud()
    for path, value in changes.items():
        set_field(cloud, path, value)

    def read() -> None:
        with pytest.raises(MessageError) as caught:
            from_point_cloud(cloud, resolution=1.0)
        assert caught.value.field == field
        assert expected in caught.value.expected
        assert repr(caught.value.found) == found

    assert peak_memory(read) < 100_000


@settings(max_examples=150)
@given(st.data())
def test_cloud_with_arbitrary_numbers_is_read_or_refused(data: st.DataObject) -> None:
    cloud = valid_cloud()
    numbers = st.sampled_from([0, 1, 3, 4, 20, 60, 119, 2**16, 2**31, HUGE]) | st.integers(0, HUGE)
    for _ in range(data.draw(st.integers(1, 3))):
        name = data.draw(st.sampled_from(["width", "height", "point_step", "row_step"]))
        setattr(cloud, name, data.draw(numbers))
    field: PointField = data.draw(st.sampled_from(cloud.fields))
    setattr(field, data.draw(st.sampled_from(["offset", "count"])), data.draw(numbers))
    field.datatype = data.draw(st.integers(0, 10))
    try:
        points = read_points(cloud)
    except MessageError:
        return
    assert {len(values) for values in points.values()} == {cloud.width * cloud.height}
    assert cloud.height * cloud.row_step == len(cloud.data)
