# SPDX-License-Identifier: BSD-3-Clause
import math
from collections.abc import Callable
from typing import Any

import pytest
from cpp_golden import assert_header, only
from geometry_msgs.msg import Point32
from hypothesis import given, strategies as st
from visualization_msgs.msg import Marker
from wire import over_the_wire

from grid_map_core_py import GeometryError, GridMapError, Polygon
from grid_map_ros_py import (
    MessageError,
    from_polygon,
    to_line_marker,
    to_polygon,
    to_triangle_list_marker,
)

GOLDEN = only("polygon")
POLYGON = Polygon(GOLDEN["vertices"])
WHERE = {"frame_id": "map", "timestamp": 5_000_000_007}
RED = (1.0, 0.0, 0.0, 0.5)

coordinates = st.floats(-1e6, 1e6, width=32)
polygons = st.lists(st.tuples(coordinates, coordinates), max_size=8).map(Polygon)


def xyz(points: Any) -> list[list[float]]:
    return [[point.x, point.y, point.z] for point in points]


# --- against C++ ----------------------------------------------------------------------------------


def test_message_equals_that_of_cpp() -> None:
    message, expected = to_polygon(POLYGON, **WHERE), GOLDEN["message"]
    assert_header(message.header, expected["header"])
    assert xyz(message.polygon.points) == expected["points"]


@pytest.mark.parametrize(
    ("marker", "expected"),
    [
        (to_line_marker(POLYGON, 0.05, RED, height=1.5, **WHERE), GOLDEN["line_marker"]),
        (
            to_triangle_list_marker(POLYGON, RED, height=1.5, **WHERE),
            GOLDEN["triangle_list_marker"],
        ),
    ],
    ids=["line", "triangles"],
)
def test_markers_equal_cpp(marker: Marker, expected: dict[str, Any]) -> None:
    assert_header(marker.header, expected["header"])
    assert (marker.type, marker.action) == (expected["type"], expected["action"])
    scale, lifetime = marker.scale, marker.lifetime
    assert [scale.x, scale.y, scale.z] == expected["scale"]
    assert [lifetime.sec, lifetime.nanosec] == expected["lifetime"]
    assert xyz(marker.points) == expected["points"]
    assert len(marker.colors) == expected["n_colors"]
    assert {(c.r, c.g, c.b, c.a) for c in marker.colors} == {RED}


# --- both ways ------------------------------------------------------------------------------------


@given(polygons)
def test_polygon_of_float32_survives_the_way_through_a_message(polygon: Polygon) -> None:
    assert from_polygon(over_the_wire(to_polygon(polygon))) == polygon


@given(polygons)
def test_triangles_equal_triangulate(polygon: Polygon) -> None:
    marker = to_triangle_list_marker(polygon)
    expected = [[*corner, 0.0] for part in polygon.triangulate() for corner in part.vertices]
    assert xyz(marker.points) == expected
    assert 3 * len(marker.colors) == len(marker.points)


@given(polygons)
def test_line_is_closed(polygon: Polygon) -> None:
    points = xyz(to_line_marker(polygon, 0.1, height=2.0).points)
    assert len(points) == (len(polygon) + 1 if len(polygon) else 0)
    assert points[:1] == points[-1:]


# --- errors ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("color", [(1, 0, 0), (1, 0, 0, 2), (0, 0, math.nan, 1), 1.0])
def test_color_has_four_components_from_0_to_1(color: Any) -> None:
    with pytest.raises(GeometryError, match="color: expected red, green, blue, alpha from 0 to 1"):
        to_line_marker(POLYGON, 0.1, color)


FAR = Polygon([(0, 0), (1e300, 0), (1, 1)])


@pytest.mark.parametrize(
    ("convert", "text"),
    [
        (lambda: to_polygon(POLYGON, timestamp=-1), "stamp: expected nanoseconds from 0"),
        (lambda: to_polygon(FAR), r"polygon\.points\[1\]: .* float32 can hold"),
        *(
            (
                lambda write=write: write(POLYGON, height=math.nan),
                "height: expected a finite number",
            )
            for write in (to_polygon, to_triangle_list_marker)
        ),
        (lambda: to_line_marker(POLYGON, 0.1, height="high"), "height: expected a number"),
        (lambda: to_line_marker(POLYGON, -0.1), "line_width: expected a finite number, 0 or more"),
        (lambda: to_line_marker(POLYGON, math.inf), "line_width: expected a finite number"),
    ],
)
def test_invalid_argument_is_named(convert: Callable[[], object], text: str) -> None:
    with pytest.raises(GridMapError, match=text):
        convert()


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_vertex_that_is_not_finite_is_named(value: float) -> None:
    message = to_polygon(POLYGON)
    message.polygon.points[2] = Point32(x=1.0, y=value)
    with pytest.raises(MessageError, match=r"polygon\.points\[2\]: expected finite coordinates"):
        from_polygon(message)
