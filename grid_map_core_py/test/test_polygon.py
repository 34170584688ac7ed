# SPDX-License-Identifier: BSD-3-Clause
"""Polygons: containment and operations."""

import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, strategies as st

import golden
from grid_map_core_py import GeometryError
from grid_map_core_py.regions import Polygon

GOLDEN = golden.load("polygon")
NAMED = {polygon["name"]: polygon for polygon in GOLDEN["polygons"]}
each_polygon = pytest.mark.parametrize("case", NAMED.values(), ids=NAMED)

SQUARE = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
CLOSE = {"rtol": 1e-6, "atol": 1e-12}
coordinates = st.floats(-100, 100) | st.integers(-3, 3).map(float)
points = st.tuples(coordinates, coordinates)


def hull_by_hand(vertices):
    """Oracle: vertices with an edge to another vertex that has no vertex on its right."""
    distinct = sorted(set(map(tuple, vertices)))
    return [
        p
        for p in distinct
        if any(
            all(turn(p, q, r) > 0 or (turn(p, q, r) == 0 and between(p, r, q)) for r in distinct)
            for q in distinct
            if q != p
        )
    ]


def turn(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def between(a, b, c):
    return math.isclose(math.dist(a, b) + math.dist(b, c), math.dist(a, c), abs_tol=1e-12)


# Golden numbers


@each_polygon
def test_area_centroid_and_bounding_box_equal_cpp(case):
    """Fewer than 3 vertices have no area and raise (contract 4); C++ gives 0 and NaN."""
    polygon = Polygon(case["vertices"])
    if len(polygon) < 3:
        for name in ("area", "centroid"):
            with pytest.raises(GeometryError, match=f"{name}: expected at least 3 vertices"):
                getattr(polygon, name)
    else:
        np.testing.assert_allclose(polygon.area, case["area"], **CLOSE)
        np.testing.assert_allclose(polygon.centroid, case["centroid"], **CLOSE)
    if "bounding_box" in case:
        center, length = polygon.bounding_box
        np.testing.assert_allclose(center, case["bounding_box"]["center"], **CLOSE)
        np.testing.assert_allclose(length, case["bounding_box"]["length"], **CLOSE)


@each_polygon
def test_is_inside_equals_cpp(case):
    if "is_inside" in case:
        polygon, inside = Polygon(case["vertices"]), case["is_inside"]["inside"]
        assert len(inside) > 60
        assert polygon.is_inside(case["is_inside"]["point"]).tolist() == inside
        for point, expected in zip(case["is_inside"]["point"], inside, strict=True):
            assert polygon.is_inside(point) is expected


@each_polygon
def test_offset_inward_equals_cpp(case):
    """Select polygons with area and distinct vertices; C++ divides by the sine of an angle of 0."""
    polygon = Polygon(case["vertices"])
    for offset in case["offset_inward"]:
        if len(polygon) and not case["area"] > 0:
            with pytest.raises(GeometryError, match="expected a polygon with an area"):
                polygon.offset_inward(offset["margin"])
        elif len(set(map(tuple, case["vertices"]))) == len(polygon):
            moved = polygon.offset_inward(offset["margin"])
            expected = np.reshape(offset["vertices"], (-1, 2))
            np.testing.assert_allclose(moved.vertices, expected, **CLOSE)


def test_coinciding_vertices_are_offset_as_one():
    twice = Polygon([(0, 0), (2, 0), (2, 0), (2, 2), (0, 2), (0, 0)]).offset_inward(0.5)
    expected = [(0.5, 0.5), (1.5, 0.5), (1.5, 0.5), (1.5, 1.5), (0.5, 1.5), (0.5, 0.5)]
    np.testing.assert_allclose(twice.vertices, expected)


@each_polygon
def test_thicken_line_equals_cpp(case):
    polygon, thickened = Polygon(case["vertices"]), case["thicken_line_0.25"]
    if thickened["ok"]:
        found = polygon.thicken_line(0.25).vertices
        np.testing.assert_allclose(found, thickened["vertices"], **CLOSE)
    else:
        with pytest.raises(GeometryError, match="thicken_line: expected 2 distinct vertices"):
            polygon.thicken_line(0.25)


@each_polygon
def test_triangulate_equals_cpp(case):
    triangles = [triangle.vertices.tolist() for triangle in Polygon(case["vertices"]).triangulate()]
    assert triangles == case["triangulate"]


@each_polygon
def test_inequality_constraints_equal_cpp(case):
    """Select cases that C++ defines; it solves singular systems for coinciding vertices."""
    polygon, expected = Polygon(case["vertices"]), case.get("inequality_constraints")
    if not case["area"] > 0:
        with pytest.raises(GeometryError, match="expected a polygon with an area"):
            polygon.to_inequality_constraints()
    elif not expected["undefined_behaviour"]:
        a, b = polygon.to_inequality_constraints()
        np.testing.assert_allclose(a, expected["A"], rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(b, np.ravel(expected["b"]), rtol=1e-6, atol=1e-12)


@each_polygon
def test_the_hull_of_one_polygon_equals_cpp(case):
    """C++ returns up to 3 points as they are; ours begin with the smallest x and turn left."""
    hull = Polygon.convex_hull(Polygon(case["vertices"])).vertices.tolist()
    expected = case["monotone_chain_of_vertices"]
    if len(case["vertices"]) > 3:
        assert hull == expected
    else:
        assert sorted(hull) == sorted(expected)
        assert hull[:1] == sorted(hull)[:1]


@pytest.mark.parametrize("case", GOLDEN["monotone_chain_clouds"], ids=lambda c: len(c["points"]))
def test_the_hull_of_a_cloud_equals_cpp(case):
    assert Polygon.convex_hull(Polygon(case["points"])).vertices.tolist() == case["hull"]


def test_hulls_of_pairs_equal_cpp():
    compared = 0
    for case in GOLDEN["convex_hull_pairs"]:
        if case["a"] in NAMED and case["b"] in NAMED:
            a, b = (Polygon(NAMED[case[key]]["vertices"]) for key in "ab")
            assert Polygon.convex_hull(a, b).vertices.tolist() == case["vertices"]
            compared += 1
    assert compared >= 10


def test_circles_and_hulls_of_two_circles_equal_cpp():
    assert len(GOLDEN["from_circle"]) * len(GOLDEN["convex_hull_of_two_circles"])
    for case in GOLDEN["from_circle"]:
        circle = Polygon.from_circle(case["center"], case["radius"], case["n_vertices"])
        np.testing.assert_allclose(circle.vertices, case["vertices"], **CLOSE)
    for case in GOLDEN["convex_hull_of_two_circles"]:
        centers = case["center1"], case["center2"]
        hull = Polygon.convex_hull_of_two_circles(*centers, case["radius"], case["n_vertices"])
        np.testing.assert_allclose(hull.vertices, case["vertices"], **CLOSE)


# Properties


def winding_by_hand(vertices, point):
    """Oracle: winding number around a point that is not on an edge, by angles."""
    vectors = [complex(*vertex) - complex(*point) for vertex in vertices]
    pairs = zip(vectors, vectors[1:] + vectors[:1], strict=True)
    angles = [math.atan2((b / a).imag, (b / a).real) for a, b in pairs]
    return round(sum(angles) / (2 * math.pi))


@given(st.lists(points, min_size=1, max_size=8), points)
def test_point_is_inside_if_winding_number_is_odd(vertices, point):
    for a, b in zip(vertices, vertices[1:] + vertices[:1], strict=True):
        if math.dist(a, point) + math.dist(point, b) <= math.dist(a, b) + 1e-9:
            return
    expected = winding_by_hand(vertices, point) % 2 == 1
    assert Polygon(vertices).is_inside(point) is expected


@given(st.lists(st.tuples(st.integers(-4, 4), st.integers(-4, 4)), min_size=3, max_size=10))
def test_a_convex_hull_of_whole_numbers_has_no_collinear_points(vertices):
    hull = Polygon.convex_hull(Polygon(vertices))
    if len(hull) > 2:
        assert sorted(map(tuple, hull.vertices.tolist())) == sorted(hull_by_hand(vertices))
        assert hull.area > 0


@given(st.lists(points, min_size=3, max_size=10), st.lists(points, min_size=1, max_size=20))
def test_constraints_of_a_convex_polygon_hold_exactly_inside(vertices, others):
    hull = Polygon.convex_hull(Polygon(vertices))
    if len(hull) < 3 or hull.area < 1e-3:
        return
    a, b = hull.to_inequality_constraints()
    slack = (b - np.asarray(others) @ a.T).min(axis=1)
    for point, least in zip(others, slack, strict=True):
        if abs(least) > 1e-6:
            assert hull.is_inside(point) == (least > 0)


@given(st.lists(points, min_size=3, max_size=8), st.floats(-5, 5))
def test_edges_of_a_convex_polygon_are_offset_by_the_margin(vertices, margin):
    hull = Polygon.convex_hull(Polygon(vertices))
    if len(hull) < 3 or not has_clear_corners(hull.vertices):
        return
    moved = hull.offset_inward(margin)
    following, moved_following = (np.roll(p.vertices, -1, axis=0) for p in (hull, moved))
    edges = zip(hull.vertices, following, moved.vertices, moved_following, strict=True)
    for a, b, c, d in edges:
        for corner in (c, d):
            distance = turn(a, b, corner) / math.dist(a, b)
            assert distance == pytest.approx(margin, rel=1e-6, abs=1e-6)


def has_clear_corners(vertices):
    edges = np.roll(vertices, -1, axis=0) - vertices
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    if lengths.min() < 1e-6:
        return False
    x, y = (edges / lengths[:, None]).T
    return np.abs(x * np.roll(y, -1) - y * np.roll(x, -1)).min() > 1e-3


@given(st.lists(points, min_size=3, max_size=8), points)
def test_area_and_centroid_do_not_depend_on_place_or_direction(vertices, shift):
    polygon = Polygon(vertices)
    turned = Polygon((polygon.vertices + shift)[::-1])
    assert turned.area == pytest.approx(polygon.area, rel=1e-9, abs=1e-6)
    if polygon.area > 1.0:
        np.testing.assert_allclose(turned.centroid - shift, polygon.centroid, atol=1e-6)


# Single cases


def test_edges_on_the_left_and_below_belong_to_a_polygon():
    inside = SQUARE.is_inside([(0, 0.5), (0.5, 0), (1, 0.5), (0.5, 1), (0, 0), (1, 1)])
    assert inside.tolist() == [True, True, False, False, True, False]
    assert not SQUARE.is_inside((np.nan, 0.5))
    assert not Polygon([]).is_inside((0, 0))
    assert SQUARE.is_inside(np.empty((0, 2))).shape == (0,)


def test_collinear_vertex_is_offset_with_its_edge():
    vertices = [(0, 0), (1, 0), (2, 0), (2, 2), (0, 2)]
    for direction in (1, -1):
        moved = Polygon(vertices[::direction]).offset_inward(0.25)
        assert [1.0, 0.25] in moved.vertices.tolist()


def test_area_and_centroid_of_far_and_flat_polygons():
    far = Polygon(SQUARE.vertices + 1e7)
    assert far.area == 1.0
    assert far.centroid.tolist() == [1e7 + 0.5, 1e7 + 0.5]
    flat = Polygon([(0, 0), (1, 1), (2, 2)])
    assert flat.area == 0.0
    assert np.isnan(flat.centroid).all()


def test_polygons_do_not_change():
    given_vertices = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)])
    polygon = Polygon(given_vertices)
    given_vertices[0] = 9.0
    assert polygon.vertices[0].tolist() == [0.0, 0.0]
    for same in (polygon, copy.deepcopy(polygon), pickle.loads(pickle.dumps(polygon))):
        with pytest.raises(ValueError, match="read-only"):
            same.vertices[0] = 9.0
    with pytest.raises(AttributeError):
        polygon.vertices = given_vertices


def test_polygons_are_equal_when_their_vertices_are():
    same = Polygon(np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=np.float32))
    assert same == SQUARE
    assert hash(same) == hash(SQUARE)
    assert Polygon([(-0.0, 0), (1, 0), (1, 1), (0, 1)]) in {SQUARE}
    assert Polygon(SQUARE.vertices[::-1]) != SQUARE
    assert SQUARE != "square"
    assert repr(Polygon([(0, 1)])) == "Polygon([[0.0, 1.0]])"


@pytest.mark.parametrize(
    "vertices",
    [[(0, np.nan)], [(0, np.inf)], [1, 2], [(1, 2, 3)], [[(1, 2)]], [(1, 2), (3,)], "abc", 3.0],
)
def test_vertices_are_pairs_of_finite_numbers(vertices):
    with pytest.raises(GeometryError, match="vertices"):
        Polygon(vertices)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Polygon([]).bounding_box, "bounding_box: expected at least 1 vertices"),
        (lambda: Polygon([(1, 1)] * 2).thicken_line(0.1), "thicken_line: expected 2 distinct"),
        (lambda: Polygon([(1, 1), (1, 2)]).thicken_line(np.nan), "thickness: expected a finite"),
        (lambda: SQUARE.offset_inward(np.inf), "margin: expected a finite number"),
        (lambda: Polygon.from_circle((0, 0), -1), "radius: expected a finite number >= 0"),
        (lambda: Polygon.from_circle((0, 0), 1, 1), "n: expected at least 2 vertices"),
        (lambda: two_circles((1, 0), 2.5), "n: expected at least 3 vertices"),
        (lambda: two_circles((1, np.nan), 20), "center2: expected two finite numbers"),
        (lambda: SQUARE.is_inside([1, 2, 3]), "points: expected x, y"),
        (lambda: Polygon.convex_hull(SQUARE, None), "vertices: expected numbers, got None"),
    ],
)
def test_wrong_arguments_are_named(call, message):
    with pytest.raises(GeometryError, match=message):
        call()


def two_circles(center, n):
    return Polygon.convex_hull_of_two_circles((0, 0), center, 1, n)
