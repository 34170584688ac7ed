# SPDX-License-Identifier: BSD-3-Clause
"""Scenes of the web viewer, without a browser."""

import json
import math
import re
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import numpy as np
import pytest
from geometry_msgs.msg import Point
from hypothesis import given, strategies as st
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from grid_map_core_py import GridMap, color_vector_to_value
from grid_map_core_py.testing import grid_maps, moved_in_buffer
from grid_map_ros_py import MessageError, ReceivedMap, to_message
from grid_map_ros_py.messages import serialize
from grid_map_ros_py.testing import wait_until
from grid_map_visualization_py._viewer.axes import axes_around
from grid_map_visualization_py._viewer.glb import on_screen, to_glb
from grid_map_visualization_py._viewer.markers import Markers
from grid_map_visualization_py._viewer.page import LARGEST_MESSAGE, Page, vector_prefixes
from grid_map_visualization_py._viewer.scene import (
    EMPTY,
    View,
    ViewSettings,
    hit,
    make_scene,
    on_surface,
    raised,
)
from grid_map_visualization_py._viewer.texts import legend, readout, status
from grid_map_visualization_py._viewer.viewer import Viewer, rate_of
from grid_map_visualization_py._web import is_allowed, is_loopback, url_of
from grid_map_visualization_py.colors import Coloring
from grid_map_visualization_py.surface import Mesh, Surface

TYPES = {5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


@pytest.fixture
def hill() -> GridMap:
    """5 x 3 cells, uneven, away from the origin, with a hole in a corner."""
    grid_map = GridMap((0.5, 0.3), 0.1, (10.0, -4.0), frame_id="map")
    grid_map["elevation"] = np.arange(15.0).reshape(5, 3) / 10
    grid_map["elevation"][0, 0] = np.nan
    grid_map["variance"] = 1.0
    return grid_map


def read_glb(data: bytes) -> tuple[dict[str, object], list[np.ndarray]]:
    """Return the description and the arrays of a GLB file."""
    magic, version, size, length, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, size, kind) == (b"glTF", 2, len(data), b"JSON")
    document = json.loads(data[20 : 20 + length])
    blob = data[28 + length :]
    assert struct.unpack_from("<I4s", data, 20 + length) == (len(blob), b"BIN\0")
    assert document["buffers"][0]["byteLength"] == len(blob)
    arrays = []
    for accessor in document["accessors"]:
        place = document["bufferViews"][accessor["bufferView"]]
        assert place["byteOffset"] % 4 == 0
        values = blob[place["byteOffset"] :][: place["byteLength"]]
        rows = np.frombuffer(values, TYPES[accessor["componentType"]])
        arrays.append(rows.reshape(accessor["count"], WIDTHS[accessor["type"]]))
    return document, arrays


# --- settings -------------------------------------------------------------------------------------


def test_layers_ending_in_x_y_and_z_are_vectors():
    layers = ["normal_x", "normal_y", "normal_z", "x", "y", "flow_x", "flow_y", "ax", "ay", "az"]
    assert vector_prefixes(layers) == ["normal_", "a"]
    assert vector_prefixes(["x", "y", "z"]) == []


def test_only_the_layers_that_are_shown_are_needed():
    assert ViewSettings(height_layer="a").layers == {"a"}
    coloring = Coloring("intensity", layer="b")
    assert ViewSettings(height_layer="a", coloring=coloring, vectors="n_").layers == {
        *("a", "b", "n_x", "n_y", "n_z")
    }
    assert ViewSettings(height_layer="a", coloring=Coloring("flat", layer="b")).layers == {"a"}


# --- surface --------------------------------------------------------------------------------------


def test_surface_reaches_the_browser_unchanged(hill):
    scene = make_scene(hill, ViewSettings(height_layer="elevation", opacity=0.5, shaded=False))
    document, (vertices, colors, faces) = read_glb(scene.glb)
    mesh = Surface(hill, "elevation").mesh(Coloring())
    np.testing.assert_array_equal(vertices, mesh.vertices)
    np.testing.assert_array_equal(faces.reshape(-1, 3), mesh.faces)
    assert (colors[:, 3] == 0xFFFF).all()
    bounds = document["accessors"][0]
    np.testing.assert_array_equal(bounds["min"], mesh.vertices.min(axis=0))
    np.testing.assert_array_equal(bounds["max"], mesh.vertices.max(axis=0))
    (material,) = document["materials"]
    assert material["alphaMode"] == "BLEND"
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == [1, 1, 1, 0.5]
    assert document["extensionsUsed"] == [*material["extensions"]] == ["KHR_materials_unlit"]
    # An opaque shaded surface needs neither.
    document, _ = read_glb(make_scene(hill, ViewSettings(height_layer="elevation")).glb)
    assert {"alphaMode", "extensions"}.isdisjoint(*document["materials"])
    assert "extensionsUsed" not in document


def test_colors_are_converted_to_linear_light():
    rgb = np.arange(256, dtype=np.uint8)
    vertices, faces = np.zeros((256, 3), np.float32), np.array([[0, 1, 2]], np.uint32)
    mesh = Mesh(np.zeros(3), vertices, faces, np.stack([rgb] * 3, axis=-1))
    _, (_, colors, _) = read_glb(to_glb(mesh))
    light = colors[:, 0] / 0xFFFF
    # sRGB to linear light, IEC 61966-2-1.
    shown = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    np.testing.assert_array_equal(np.rint(255 * shown), rgb)


@given(grid_maps(allow_moved=False))
def test_any_map_gives_a_scene_and_moved_maps_the_same(grid_map):
    layer = "elevation"
    settings = ViewSettings(height_layer=layer, grid_lines=True)
    scene = make_scene(grid_map, settings)
    assert (scene.glb is None) == (len(scene.mesh.faces) == 0)
    assert np.isfinite([scene.view.start, scene.view.target]).all()
    known = np.isfinite(grid_map[layer])
    pairs = (known[1:] & known[:-1]).sum() + (known[:, 1:] & known[:, :-1]).sum()
    assert len(scene.grid_lines) == pairs
    rows, columns = grid_map.size
    moved = make_scene(moved_in_buffer(grid_map, (rows // 2, columns // 2)), settings)
    assert moved.glb == scene.glb
    np.testing.assert_array_equal(moved.grid_lines, scene.grid_lines)


def test_scene_knows_the_cells_that_are_shown():
    grid_map = GridMap((4.0, 2.0), 0.1, layers={"elevation": 0.0})
    scene = make_scene(grid_map, ViewSettings(height_layer="elevation"), max_drawn_cells=300)
    assert len(scene.mesh.vertices) == np.prod(scene.size) <= 300
    assert 0.15 < scene.spacing < 0.3


# --- overlays -------------------------------------------------------------------------------------


def test_grid_lines_lie_between_neighbors_with_heights(hill):
    scene = make_scene(hill, ViewSettings(height_layer="elevation", grid_lines=True))
    lengths = np.linalg.norm(np.diff(scene.grid_lines[..., :2], axis=1), axis=-1)
    np.testing.assert_allclose(lengths, 0.1, rtol=1e-5)
    ends = scene.grid_lines.reshape(-1, 3) - [0, 0, 0.002]
    distances = np.linalg.norm(ends[:, None] - scene.mesh.vertices, axis=-1)
    assert distances.min(axis=1).max() < 1e-5


def test_vectors_start_on_the_surface_where_all_is_finite(hill):
    hill["n_x"], hill["n_y"], hill["n_z"] = 1.0, 2.0, 3.0
    hill["n_y"][4, 2] = np.nan
    scene = make_scene(hill, ViewSettings(height_layer="elevation", vectors="n_", vector_scale=0.5))
    assert len(scene.vectors) == 15 - 2
    arrows = np.diff(scene.vectors, axis=1)[:, 0]
    np.testing.assert_allclose(arrows, np.tile([0.5, 1.0, 1.5], (13, 1)), rtol=1e-5)
    heights = sorted(scene.vectors[:, 0, 2].tolist())
    np.testing.assert_allclose(heights, np.arange(1, 14) / 10, rtol=1e-6)


def test_path_lies_just_above_the_drawn_surface(hill):
    settings = ViewSettings(height_layer="elevation")
    # A cell center, a point between two centers, the hole, and a point beside the map.
    points = np.array([[10.0, -4.0, 9.0], [10.05, -4.0, 9.0], [10.2, -3.9, 9.0], [11.0, -4.0, 9.0]])
    expected = [0.7 + 0.02, 0.55 + 0.02, 9.0, 9.0]
    for grid_map in (hill, moved_in_buffer(hill, (2, 1))):
        found = on_surface(grid_map, settings, points)
        np.testing.assert_allclose(found[:, 2], expected, atol=1e-6)
        np.testing.assert_array_equal(found[:, :2], points[:, :2])
    flat = on_surface(hill, ViewSettings(height_layer="elevation", flat=True), points)
    np.testing.assert_allclose(flat[:, 2], 0.02)
    assert (points[:, 2] == 9.0).all()


def marker(kind: int, count: int, *, number: int = 0, **fields: object) -> Marker:
    """Return a marker at (1, 2, 3), turned by 90 degrees, with points along its x axis."""
    message = Marker(header=Header(frame_id="odom"), id=number, type=kind, **fields)
    place, turn = message.pose.position, message.pose.orientation
    place.x, place.y, place.z, turn.z, turn.w = 1.0, 2.0, 3.0, 0.5**0.5, 0.5**0.5
    message.points = [Point(x=float(index)) for index in range(count)]
    message.color = ColorRGBA(r=1.0, g=0.2, b=0.0, a=0.4)
    return message


def test_markers_become_lines_and_triangles_in_their_frame():
    markers = Markers()
    strip, pairs, faces = (marker(kind, 5 + kind, number=kind) for kind in (4, 5, 11))
    faces.colors = [ColorRGBA(r=index / 255.0, a=1.0 - index / 51) for index in range(16)]
    markers.receive(MarkerArray(markers=[strip, pairs, faces]))
    assert markers.frames == {"odom"}
    drawing = markers.drawing("odom")
    # Incomplete pairs and triangles are left out.
    y = [[k, k + 1] for k in range(8)] + [[k, k + 1] for k in range(0, 10, 2)]
    np.testing.assert_allclose(drawing.lines[..., 1], np.add(y, 2.0))
    np.testing.assert_allclose(drawing.lines[..., ::2], np.broadcast_to([1.0, 3.0], (13, 2, 2)))
    assert (drawing.line_colors == (255, 51, 0)).all()
    np.testing.assert_allclose(drawing.triangles[..., 1], np.arange(15).reshape(5, 3) + 2.0)
    np.testing.assert_array_equal(drawing.triangle_colors[..., 0], np.arange(15).reshape(5, 3))
    assert drawing.opacity == pytest.approx(1.0 - 15 / 51, abs=0.01)
    assert all(map(np.array_equal, markers.drawing("map"), EMPTY))


def test_markers_are_replaced_and_deleted_by_namespace_and_id():
    markers = Markers()
    first = [marker(4, 2, number=1, ns="a"), marker(4, 3, number=1, ns="b"), marker(4, 4, number=2)]
    markers.receive(MarkerArray(markers=first))
    assert len(markers.drawing("odom").lines) == 6
    gone = Marker(action=Marker.DELETE, ns="b", id=1)
    markers.receive(MarkerArray(markers=[marker(4, 11, number=1, ns="a"), gone]))
    assert len(markers.drawing("odom").lines) == 13
    markers.receive(MarkerArray(markers=[Marker(action=Marker.DELETEALL), first[0]]))
    assert len(markers.drawing("odom").lines) == 1


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"type": 1}, "markers[1].type: expected 4 (line strip), 5 (line list) or 11 (triangle"),
        ({"colors": [ColorRGBA()] * 2}, "markers[1].colors: expected no color, or one for each of"),
        ({"points": [Point(y=np.inf)]}, "markers[1].points[0]: expected finite coordinates"),
    ],
)
def test_wrong_marker_is_named_and_changes_nothing(wrong, text):
    markers, message = Markers(), marker(4, 3)
    markers.receive(MarkerArray(markers=[message]))
    bad = marker(4, 3)
    for name, value in wrong.items():
        setattr(bad, name, value)
    with pytest.raises(MessageError, match=re.escape(text)):
        markers.receive(MarkerArray(markers=[Marker(action=Marker.DELETEALL), bad]))
    assert len(markers.drawing("odom").lines) == 2


def test_drawings_lie_just_above_their_heights_or_the_flat_surface(hill):
    markers = Markers()
    markers.receive(MarkerArray(markers=[marker(4, 2), marker(11, 3, number=1)]))
    drawing = markers.drawing("odom")
    for flat, height in ((False, 3.02), (True, 0.02)):
        settings = ViewSettings(height_layer="elevation", flat=flat)
        found = raised(drawing, hill, settings)
        for before, after in ((drawing.lines, found.lines), (drawing.triangles, found.triangles)):
            np.testing.assert_array_equal(before[..., :2], after[..., :2])
            np.testing.assert_allclose(after[..., 2], height)


def test_the_legend_has_the_values_of_the_colors(hill):
    coloring = Coloring("intensity", "elevation", "gray", upper=3.0)
    scene = make_scene(hill, ViewSettings(height_layer="elevation", coloring=coloring))
    assert scene.bounds == (pytest.approx(0.1), 3.0)
    text = legend(coloring, scene.bounds, "<b> [m]")
    assert ">&lt;b&gt; [m]<" in text
    assert ">0.1<" in text
    assert ">3<" in text
    black, *_, white = legend_colors(text)
    assert (black, white) == ((0, 0, 0), tuple(on_screen(np.full(3, 255, np.uint8)).tolist()))
    inverted = legend(Coloring(color_map="gray", invert=True), scene.bounds, "")
    assert legend_colors(inverted) == legend_colors(text)[::-1]
    hill["elevation"] = np.nan
    bounds = make_scene(hill, ViewSettings(height_layer="elevation")).bounds
    assert "<span></span>" in legend(Coloring(), bounds, "")
    # A layer that was selected before has no effect.
    flat = ViewSettings(height_layer="elevation", coloring=Coloring("flat", layer="gone"))
    assert make_scene(hill, flat).bounds is None


def legend_colors(text: str) -> list[tuple[int, ...]]:
    return [tuple(map(int, rgb)) for rgb in re.findall(r"rgb\((\d+),(\d+),(\d+)\)", text)]


def test_screen_colors_equal_those_recorded_in_chromium():
    viridis = np.array([[0x44, 0x01, 0x54], [0xFD, 0xE7, 0x25]], np.uint8)
    seen = np.array([[48, 0, 72], [230, 220, 100]])
    np.testing.assert_allclose(on_screen(viridis).astype(int), seen, atol=2)


def test_view_aims_at_the_center_of_the_map(hill):
    seen = make_scene(hill, ViewSettings(height_layer="elevation")).view
    np.testing.assert_allclose(seen.target, [10.0, -4.0, 0.75])
    reach = math.hypot(0.5, 0.3)
    np.testing.assert_allclose(seen.start - seen.target, np.multiply(reach, [-0.5, -0.5, 0.6]))


@pytest.mark.parametrize(
    ("shift", "scale", "is_lost"),
    [
        ((0.0, 0.0, 0.0), 1.0, False),
        ((0.9, 0.0, 0.0), 1.0, False),
        ((0.9, -0.9, 0.0), 1.0, True),
        ((0.0, 0.0, 5.0), 1.0, False),
        ((0.0, 0.0, 0.0), 2.5, False),
        ((0.0, 0.0, 0.0), 3.5, True),
        ((0.0, 0.0, 0.0), 0.3, True),
    ],
)
def test_view_excludes_distant_maps_and_other_scales(shift, scale, is_lost):
    place, offset = np.array([5e5, -100.0, 2.0]), np.array([0.0, -0.6, 0.8])
    before = View(place + offset, place)
    after = View(place + shift + scale * offset, place + shift)
    assert before.loses(after) == is_lost
    assert before.is_like(after) == (not any(shift) and scale == 1.0)


# --- axes -----------------------------------------------------------------------------------------


@given(
    st.floats(-1e5, 1e5),
    st.floats(0.01, 1e4),
    st.floats(0.01, 1e4),
    st.floats(0.0, 1e3),
    st.floats(1, 20),
)
def test_axes_enclose_the_map_with_few_round_ticks(start, length, width, height, exaggeration):
    low = np.array([start, -start, 0.1 * start])
    high = low + [length, width, height]
    axes = axes_around(low, high, exaggeration)
    first, last, steps = np.array(axes.low), np.array(axes.high), np.array(axes.steps)
    assert (first * steps <= low + 1e-9 * abs(low)).all()
    assert (last * steps >= high - 1e-9 * abs(high)).all()
    assert ((last - first >= 1) & (last - first <= 10)).all()
    digits = {f"{step:e}"[:8] for step in axes.steps}
    assert digits <= {"1.000000", "2.000000", "5.000000"}
    lines = axes.lines() + axes.corner
    np.testing.assert_allclose(lines.min(axis=(0, 1)), first * steps, atol=1e-3)
    labels = axes.labels()
    texts = [text for text, _, _ in labels]
    assert len(texts) == (last - first + 1).sum() + 2
    assert len({at for _, at, anchor in labels if anchor != "top-left"}) == len(texts) - (
        (last - first)[0] + 2
    )
    names = {text: at for text, at, _ in labels if text.endswith("[m]")}
    assert [*names] == ["x [m]", "y [m]", "z [m]"]
    # The middle of an edge is not covered by the panels of the page.
    for axis in (0, 1):
        middle = 0.5 * (last - first)[axis] * steps[axis]
        assert abs(names["xy"[axis] + " [m]"][axis] - middle) <= 0.51 * steps[axis]
    assert float(texts[1]) == pytest.approx((first[0] + 1) * steps[0])


# --- the pointer ----------------------------------------------------------------------------------


def naive_hit(mesh: Mesh, start: np.ndarray, direction: np.ndarray) -> np.ndarray | None:
    """Solve for every triangle where the ray meets its plane."""
    distances = []
    for face in mesh.faces:
        first, second, third = mesh.vertices[face].astype(np.float64) + mesh.origin
        system = np.stack([second - first, third - first, -direction], axis=-1)
        if abs(np.linalg.det(system)) < 1e-12:
            continue
        u, v, distance = np.linalg.solve(system, start - first)
        if u >= 0 and v >= 0 and u + v <= 1 and distance > 0:
            distances.append(distance)
    return start + min(distances) * direction if distances else None


@given(st.integers(0, 2**32 - 1))
def test_a_ray_meets_the_first_triangle_of_a_surface(seed):
    random = np.random.default_rng(seed)
    grid_map = GridMap((0.6, 0.5), 0.1, (3.0, 2.0))
    grid_map["elevation"] = random.uniform(0, 0.3, (6, 5))
    grid_map["elevation"][random.uniform(size=(6, 5)) < 0.1] = np.nan
    mesh = Surface(grid_map, "elevation").mesh(Coloring())
    start = np.array([3.0, 2.0, 0.15]) + random.normal(size=3)
    aim = np.array([*random.uniform((2.8, 1.8), (3.2, 2.2)), 0.15])
    found, expected = hit(mesh, start, aim - start), naive_hit(mesh, start, aim - start)
    assert (found is None) == (expected is None)
    if expected is not None:
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_ray_from_below_or_away_and_an_empty_surface(hill):
    mesh = Surface(hill, "elevation", flat=True).mesh(Coloring())
    below = np.array([10.05, -4.03, -1.0])
    np.testing.assert_allclose(hit(mesh, below, np.array([0, 0, 0.5])), [10.05, -4.03, 0])
    assert hit(mesh, below, np.array([0, 0, -1])) is None
    assert hit(mesh, below, np.array([1, 0, 0])) is None
    empty = Surface(GridMap((0.1, 0.1), 0.1, layers={"a": 0.0}), "a").mesh(Coloring())
    assert hit(empty, below, np.array([0, 0, 1])) is None


def test_the_readout_names_the_cell_and_all_its_values(hill):
    hill["color"] = color_vector_to_value([255, 16, 0])
    hill["x"] = 7.0
    text = readout(hill, np.array([10.12, -4.08]))
    values = {"y": "-4.080 m", "cell": "1, 2", "elevation": "0.5", "variance": "1"}
    for name, value in (("x", "10.120 m"), ("x", "7"), ("color", "#ff1000"), *values.items()):
        assert f"<td>{name}</td><td style='text-align:right'>{value}</td>" in text
    assert ">no data<" in readout(hill, np.array([10.2, -3.9]))
    assert ">outside the map<" in readout(hill, np.array([0.0, 0.0]))


def test_names_from_messages_are_no_html():
    grid_map = GridMap((0.2, 0.2), 0.1, layers={"<b>": 1.0}, frame_id="<i>")
    texts = readout(grid_map, np.zeros(2)) + status(grid_map, (2, 2), 1.0, 0.0, 0)
    assert "&lt;b&gt;" in texts
    assert "&lt;i&gt;" in texts
    assert not {"<b>", "<i>"} & {texts[k : k + 3] for k in range(len(texts))}


def test_the_status_tells_cells_and_times(hill):
    text = status(hill, (5, 3), 10.04, 0.2, 10**18)
    for value in ("5 x 3", "0.1 m", "10.0 Hz", "0 s ago", "(none)", "(unknown)"):
        assert f">{value}<" in text
    # In a simulation, and on a day.
    for stamp, shown in ((1_500_000_000, "1.500 s"), (10**18 * 2, "2033-05-18 03:33:20.0 UTC")):
        hill.timestamp = stamp
        text = status(hill, (3, 2), 10.04, 70.2, stamp + 2_540_000_000, is_paused=True)
        for value in ("3 x 2 of 5 x 3", "70 s ago, paused", shown, "2.5 s"):
            assert f">{value}<" in text


def test_only_addresses_of_this_machine_need_no_warning():
    hosts = ("127.0.0.1", "localhost", "::1", "0.0.0.0", "192.168.0.7", "robot.local")
    assert [*map(is_loopback, hosts)] == [True, True, True, False, False, False]


@pytest.mark.parametrize(
    ("host", "origin", "allowed"),
    [
        ("127.0.0.1:8080", None, True),
        ("127.0.0.1:8080", "http://127.0.0.1:8080", True),
        ("192.168.0.7:8080", "http://192.168.0.7:8080", True),
        ("[::1]:8080", "http://[::1]:8080", True),
        ("Localhost:80", "http://localhost:80", True),
        ("viewer.robot", "https://viewer.robot", True),
        ("127.0.0.1:8080", "http://127.0.0.1:9999", False),
        ("127.0.0.1:8080", "http://evil.example", False),
        ("127.0.0.1:8080", "null", False),
        ("127.0.0.1:8080", "", False),
        ("evil.example:8080", "http://evil.example:8080", False),
        ("localhost.evil.example", None, False),
        ("", None, False),
        ("[::1", None, False),
        ("127.0.0.1:8080", "http://[", False),
    ],
)
def test_only_the_page_itself_may_send_requests(host, origin, allowed):
    headers = {"Host": host} if origin is None else {"Host": host, "Origin": origin}
    assert is_allowed(headers, {"localhost", "viewer.robot"}) == allowed


def test_printed_address_can_be_opened():
    assert url_of("127.0.0.1", 8080) == "http://127.0.0.1:8080"
    assert url_of("::1", 80) == "http://[::1]:80"
    assert url_of("0.0.0.0", 80) == url_of("::", 80) == f"http://{socket.gethostname()}:80"


def test_rate_covers_the_last_seconds():
    times = [0.1 * k for k in range(40)]
    assert rate_of([], 0.0) == rate_of(times, 9.0) == rate_of([*times, 9.5], 9.5) == 0.0
    assert rate_of(times, 3.9) == pytest.approx(10.0)
    assert rate_of([*times, 9.5, 10.0], 10.0) == pytest.approx(2.0)


# --- the page -------------------------------------------------------------------------------------


@pytest.fixture
def page() -> Iterator[Page]:
    pytest.importorskip("viser")
    page = Page("127.0.0.1", 0, "z")
    yield page
    page.close()


@contextmanager
def connected(page: Page) -> Iterator[Callable[[dict[str, object]], None]]:
    """Connect as a browser does; yield a function that sends a message."""
    viser = pytest.importorskip("viser")
    connect = pytest.importorskip("websockets.sync.client").connect
    encode = pytest.importorskip("msgspec.msgpack").encode
    camera = {"type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0)}
    camera |= dict.fromkeys(("position", "look_at", "up_direction"), (1.0, 2.0, 3.0))
    camera |= {"fov": 1.0, "near": 0.1, "far": 9.0, "image_height": 4, "image_width": 4}
    address = page.url.replace("http", "ws")
    with connect(address, subprotocols=[f"viser-v{viser.__version__}"]) as socket:
        send = lambda message: socket.send(encode(message))  # noqa: E731
        send(camera)
        wait_until(lambda: page.is_watched, "the connection")
        yield send


def test_larger_messages_than_pictures_end_their_connection(page):
    closed = pytest.importorskip("websockets.exceptions").ConnectionClosed
    picture = {"type": "GetRenderResponseMessage", "payload": bytes(LARGEST_MESSAGE)}
    with connected(page) as send:
        with suppress(closed):
            send(picture)
        # It may end after the whole message was sent.
        wait_until(lambda: not page.is_watched, "its end")
        with pytest.raises(closed, match="1009"):
            send(picture)


def test_missing_selected_layer_is_replaced_by_preferred_or_first(page):
    chosen = {"b elevation z": "z", "b elevation": "elevation", "b a_x a_y a_z": "b", "c a": "c"}
    for layers, layer in chosen.items():
        page.offer((*layers.split(),))
        settings = page.settings()
        assert (settings.height_layer, settings.coloring.layer) == (layer, layer)
        assert settings.vectors == ""


def test_page_starts_with_a_reversed_color_map():
    page = Page("127.0.0.1", 0, "elevation", color_map="RdYlGn_r")
    assert page.settings().coloring.color_map == "RdYlGn_r"
    page.close()


def test_map_is_hidden_while_it_is_loaded(page, hill):
    def load(*, replaces: bool) -> None:
        settings = ViewSettings(height_layer="elevation", points=True, grid_lines=True)
        page.load(make_scene(hill, settings), settings, replaces=replaces)

    def visible() -> list[int]:
        """Return the numbers of the visible maps, the oldest first."""
        assert all(frame.visible for frame in page._shown)
        assert not page._loading or not page._loading.visible
        return [int(frame.name.rpartition("/")[2]) for frame in page._shown]

    load(replaces=False)
    assert visible() == []
    page.turn(1)
    assert visible() == [0]
    load(replaces=False)
    assert visible() == [0]
    page.turn(1)
    assert visible() == [1]
    # Names are used again.
    load(replaces=False)
    page.turn(3)
    assert visible() == [1, 0]
    # A map that was never shown is dropped, and the next style belongs to its successor.
    load(replaces=False)
    load(replaces=True)
    page.turn(3)
    assert visible() == [1, 0, 2]
    # The same map in another style replaces the newest.
    load(replaces=True)
    page.turn(3)
    assert visible() == [1, 0, 3]
    page.turn(1)
    assert visible() == [3]


@pytest.mark.parametrize("is_watched", [True, False])
def test_map_that_contradicts_itself_is_refused_on_arrival(page, hill, monkeypatch, is_watched):
    monkeypatch.setattr(Page, "is_watched", is_watched)
    notes = []
    monkeypatch.setattr(Page, "tell", lambda _, text: notes.append(text))
    viewer = Viewer(page, 0)
    message = to_message(hill)
    good = serialize(message)
    # A layer that the page does not show.
    message.layers = [*message.layers, "hidden"]
    message.data = [*message.data, type(message.data[0])()]
    viewer.receive(ReceivedMap(good))
    assert viewer.update() == ""
    with pytest.raises(MessageError, match="layer 'hidden'"):
        viewer.receive(ReceivedMap(serialize(message)))
    assert viewer.update() == ""
    viewer.receive(ReceivedMap(good))
    assert viewer.update() == ""
    assert ["hidden" in note for note in notes] == [False, True, False] * is_watched
