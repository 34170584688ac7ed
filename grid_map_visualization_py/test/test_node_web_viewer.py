# SPDX-License-Identifier: BSD-3-Clause
"""The web viewer: a node that receives maps over DDS, viewed in headless Chromium."""

import http.server
import math
import re
import shutil
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import Path as PathMessage
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import testing, to_message
from grid_map_ros_py.nodes import map_qos
from grid_map_ros_py.testing import Peer, Process, running, wait_until
from grid_map_visualization_py._viewer.glb import on_screen

pytestmark = pytest.mark.timeout(600)

MODULE = "grid_map_visualization_py._executables.web_viewer"
TALKATIVE = f"""
import sys
from types import ModuleType, SimpleNamespace

# tf2 is no package of Python. The robot is at (2, 1, 0.5) and looks towards +y.
tf2 = sys.modules["tf2_ros"] = ModuleType("tf2_ros")
tf2.__spec__, tf2.TransformException = SimpleNamespace(), LookupError
tf2.Buffer, tf2.TransformListener = SimpleNamespace, lambda buffer, node: setattr(
    buffer, "lookup_transform", look_up
)
def look_up(target, source, time):
    from geometry_msgs.msg import TransformStamped
    if (target, source) != ("base", "odom"):
        raise LookupError
    found = TransformStamped()
    move, turn = found.transform.translation, found.transform.rotation
    move.x, move.y, move.z, turn.z, turn.w = -1.0, 2.0, -0.5, -(0.5**0.5), 0.5**0.5
    return found

import {MODULE} as module
from grid_map_ros_py import ReceivedMap
decode = ReceivedMap.decode
def talk(self, layers=None):
    if layers != []:  # Then it only checks the message.
        print("decoded", *sorted(["everything"] if layers is None else layers))
    return decode(self, layers)
ReceivedMap.decode = talk
sys.exit(module.WebViewerNode.main())
"""
PICTURES = Path(__file__).parents[2] / "demo_output"

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
"""The browser of the system; without one, Playwright takes the one that it has installed."""
FLAGS = (
    *("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--disable-background-networking", "--disable-component-update", "--disable-quic"),
    *("--disable-sync", "--no-first-run", "--disable-gpu-compositing"),
)

FEW_FRAMES = """
const request = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (draw) => setTimeout(() => request(draw), 50);
window.cancelAnimationFrame = clearTimeout;
"""
"""Script that limits a page to 20 frames per second, because drawing without a GPU is slow."""

VIRIDIS, COOLWARM = (
    tuple(map(tuple, on_screen(np.array(ends, np.uint8)).tolist()))
    for ends in ([(0x44, 0x01, 0x54), (0xFD, 0xE7, 0x25)], [(0x3B, 0x4C, 0xC0), (0xB4, 0x04, 0x26)])
)
"""Colors at the ends of these color maps, as the screen shows them."""

VIEWPORT = {"width": 900, "height": 640}
MAX_CELLS = 5000

PATIENCE = 100.0
"""Seconds that a slow machine may need to draw."""


def slope(**layers: np.ndarray | float) -> GridMap:
    """Return 21 x 21 cells around (1, 2) that rise by 0.2 m per meter of x, with more layers."""
    grid_map = GridMap((2.1, 2.1), 0.1, (1.0, 2.0), frame_id="odom", timestamp=12_340_000_000)
    x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
    grid_map["elevation"] = 0.2 * x
    for name, values in {"x": x, "y": y, "side": y > 2.05, **layers}.items():
        grid_map[name] = values
    return grid_map


class Browser:
    """A tab that shows the page.

    Attributes:
        tab: Playwright's page.
        errors: error messages of the browser.
    """

    def __init__(self, tab: object) -> None:
        self.tab = tab
        self.errors: list[str] = []
        tab.add_init_script(FEW_FRAMES)
        tab.set_default_timeout(1e3 * PATIENCE)
        tab.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        tab.on("pageerror", lambda error: self.errors.append(str(error)))

    def picture(self) -> np.ndarray:
        """Return a picture of the scene, (rows, columns, 3) red, green, blue."""
        box = self.tab.locator("canvas").first.bounding_box()
        # Notices cover the top of the scene.
        clip = {**box, "y": box["y"] + 190, "height": box["height"] - 190}
        return decoded(self.tab.screenshot(clip=clip))

    def shows(self, *colors: tuple[int, int, int]) -> bool:
        """Return whether each of these colors covers at least 2 % of the scene."""
        return all(share(self.picture(), color) > 0.02 for color in colors)

    def wait_for(self, condition: Callable[[], object], what: str) -> None:
        step = lambda: self.tab.wait_for_timeout(100)  # noqa: E731
        try:
            wait_until(condition, what, step=step, timeout=PATIENCE)
        except AssertionError:
            self.tab.screenshot(path=PICTURES / "web_viewer_failed.png")
            raise

    def change_picture(self, change: Callable[[], object]) -> None:
        """Change the scene, and wait until it looks different."""
        before = self.picture()
        change()
        self.wait_for(lambda: differs(self.picture(), before), "another picture")

    def wait_for_colors(self, *colors: tuple[int, int, int]) -> None:
        self.wait_for(lambda: self.shows(*colors), f"the colors {colors}")

    def control(self, label: str) -> object:
        return self.tab.get_by_label(label, exact=True)

    def choose(self, label: str, option: str) -> None:
        self.control(label).click()
        self.tab.get_by_role("option", name=option, exact=True).click()

    def click(self, across: float, down: float) -> None:
        """Click on a place of the scene, counted in parts of its width and height."""
        box = self.tab.locator("canvas").first.bounding_box()
        self.tab.mouse.click(box["x"] + across * box["width"], box["y"] + down * box["height"])

    def legend_title(self) -> str:
        return self.tab.locator("b").inner_text()

    def open_folders(self) -> None:
        for name in ("Surface", "Color", "Overlays"):
            self.tab.get_by_text(name, exact=True).click()

    def exaggerate(self, steps: int) -> None:
        """Move the slider to this number of steps of 0.5 above 1."""
        slider = self.tab.get_by_role("slider").first
        for key in ("Home", *["ArrowRight"] * steps):
            slider.press(key)

    def values(self) -> dict[str, str]:
        """Return the rows of all tables on the page by name; the first of equal names."""
        cells = self.tab.locator("td").all_inner_texts()[::-1]
        return dict(zip(cells[1::2], cells[::2], strict=True))

    def place(self) -> tuple[float, float]:
        """Return x and y [m] of the place that was clicked."""
        values = self.values()
        return tuple(float(values.get(axis, "nan").removesuffix(" m")) for axis in "xy")


def decoded(png: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def share(picture: np.ndarray, color: tuple[int, int, int], tolerance: int = 3) -> float:
    return float((np.abs(picture.astype(int) - color) <= tolerance).all(axis=-1).mean())


def differs(picture: np.ndarray, other: np.ndarray) -> bool:
    """Return whether at least 0.5 % of the pixels of two pictures differ."""
    return float((np.abs(picture.astype(int) - other) > 30).any(axis=-1).mean()) > 0.005


@pytest.fixture(scope="module")
def peer() -> Iterator[Peer]:
    with testing.peer() as other:
        yield other


@pytest.fixture(scope="module")
def publish(peer: Peer) -> Callable[..., None]:
    return lambda grid_map: peer.publish("/grid_map", to_message(grid_map))


def start_viewer(**parameters: object) -> Process:
    words = (word for name, value in parameters.items() for word in ("-p", f"{name}:={value}"))
    return Process([sys.executable, "-c", TALKATIVE, "--ros-args", *words])


def url_of(node: Process) -> str:
    pattern = re.compile(r"shows \S+ in the browser at\n(http://\S+)\n")
    is_told = lambda: pattern.search(node.text) or not node.is_running  # noqa: E731
    wait_until(is_told, "the address of the page", timeout=PATIENCE)
    assert node.is_running, node.text
    return pattern.search(node.text)[1]


@pytest.fixture(scope="module")
def node() -> Iterator[Process]:
    settings = {"color_layer": "side", "max_drawn_cells": MAX_CELLS, "robot_frame": "base"}
    with running(start_viewer(port=0, **settings)) as process:
        yield process


@pytest.fixture(scope="module")
def chromium() -> Iterator[object]:
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def tab(chromium: object, node: Process, publish: Callable[..., None]) -> Browser:
    url = url_of(node)
    publish(slope())
    publish(slope())
    assert "decoded" not in node.text
    browser = Browser(chromium.new_page(viewport=VIEWPORT))
    browser.tab.goto(url)
    browser.open_folders()
    browser.control("Shaded").set_checked(False)
    return browser


@pytest.fixture
def page(tab: Browser) -> Iterator[Browser]:
    """The page with the map `slope()` in viridis; every test leaves it so."""
    tab.wait_for_colors(*VIRIDIS)
    yield tab
    assert tab.errors == []


@pytest.fixture(scope="module")
def beside(chromium: object, node: Process, tab: Browser) -> Iterator[Browser]:
    """Another browser with the same page."""
    tab.wait_for_colors(*VIRIDIS)
    browser = Browser(chromium.new_page(viewport={"width": 1280, "height": 720}))
    browser.tab.goto(url_of(node))
    browser.wait_for_colors(*VIRIDIS)
    yield browser
    assert browser.errors == []


def test_page_shows_the_map_and_decodes_only_shown_layers(page, node):
    values = page.values()
    assert (values["Frame"], values["Cells"]) == ("odom", "21 x 21")
    assert values["Time"] == "12.340 s"
    # In the year 2000 or later, by the clock of the system.
    assert float(values["Age"].removesuffix(" s")) > 9e8
    assert page.legend_title() == "side"
    page.tab.screenshot(path=PICTURES / "web_viewer.png")
    assert "decoded elevation side\n" in node.lines
    assert not [line for line in node.lines if line.startswith("decoded e") and " x" in line]


def test_color_map_inversion_and_one_color_change_the_surface(page):
    page.choose("Color map", "coolwarm")
    page.wait_for_colors(*COOLWARM)
    warm_on_left = lambda: share(np.array_split(page.picture(), 3, axis=1)[0], COOLWARM[1])  # noqa: E731
    before = warm_on_left()
    page.control("Inverted").check()
    page.wait_for(lambda: abs(warm_on_left() - before) > 0.02, "other colors on the left")
    page.choose("Color by", "one color")
    page.wait_for(lambda: not page.shows(COOLWARM[1]), "one color")
    assert "Frame" in page.values()
    page.choose("Color by", "layer")
    page.wait_for_colors(*COOLWARM)
    page.control("Inverted").uncheck()
    page.wait_for(lambda: abs(warm_on_left() - before) < 0.02, "the colors of before")
    page.choose("Color map", "viridis")
    page.wait_for_colors(*VIRIDIS)


def test_page_names_senseless_bounds_and_uses_valid_ones(page):
    page.control("Automatic bounds").uncheck()
    page.control("Upper bound").fill("-1")
    page.tab.get_by_text("expected more than lower").wait_for()
    page.wait_for_colors(*VIRIDIS)
    page.control("Upper bound").fill("1000")
    page.wait_for(lambda: not page.shows(VIRIDIS[1]), "colors of the lower end alone")
    page.control("Automatic bounds").check()
    page.wait_for_colors(*VIRIDIS)


AT_ONCE = """([inverted, automatic, bound]) => {
    inverted.click();
    automatic.click();
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(bound, "-1");
    bound.dispatchEvent(new Event("input", {bubbles: true}));
}"""


def test_bound_typed_at_once_replaces_automatic_bounds(page):
    # Within 50 ms, viser sends the first and the last change only.
    labels = "Inverted", "Automatic bounds", "Upper bound"
    page.tab.evaluate(AT_ONCE, [page.control(label).element_handle() for label in labels])
    page.tab.get_by_text("expected more than lower").wait_for()
    assert not page.control("Automatic bounds").is_checked()
    page.control("Inverted").uncheck()
    page.control("Upper bound").fill("1")
    page.wait_for_colors(*VIRIDIS)
    page.control("Automatic bounds").check()


@pytest.mark.parametrize("steps", [0, 4])
def test_click_shows_values_of_the_cell_at_any_exaggeration(page, node, steps):
    if steps:
        page.change_picture(lambda: page.exaggerate(steps))

    def is_in_the_middle() -> bool:
        # The view rises with the middle of the map.
        page.click(0.5, 0.5)
        return page.values().get("cell") == "10, 10"

    page.wait_for(is_in_the_middle, "the readout")
    values = page.values()
    assert page.place()[0] == pytest.approx(1.0, abs=0.02)
    assert float(values["elevation"]) == pytest.approx(0.2, abs=1e-5)
    assert float(values["side"]) == 0.0
    assert "decoded everything\n" in node.lines
    # Looking towards +x and +y, further right is further along +x and -y.
    page.click(0.65, 0.5)
    page.wait_for(lambda: page.values()["cell"] != "10, 10", "another cell")
    values, (x, y) = page.values(), page.place()
    assert x > 1.05
    assert y < 1.95
    row, column = map(int, values["cell"].split(", "))
    center = 2.0 - 0.1 * row, 3.0 - 0.1 * column
    assert (x, y) == pytest.approx(center, abs=0.051)
    assert float(values["elevation"]) == pytest.approx(0.2 * center[0], abs=1e-5)
    page.click(0.98, 0.98)
    page.tab.get_by_text("There is no map at this place").wait_for()
    page.exaggerate(0)


def is_red(picture: np.ndarray) -> np.ndarray:
    """Return where the x axes of frames are."""
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    return (red > 100) & (green < 60) & (blue < 60)


def test_origin_and_robot_are_seen_from_above(beside):
    beside.tab.get_by_role("button", name="Top view").click()

    def axes() -> list[tuple[int, ...]]:
        """Return left, top, width and height of the x axes, from left to right."""
        mask = is_red(beside.picture()).astype(np.uint8)
        _, _, found, _ = cv2.connectedComponentsWithStats(mask)
        return sorted(tuple(row[:4]) for row in found[1:].tolist() if row[4] > 50)

    beside.wait_for(lambda: len(axes()) == 2 and axes()[0][3] < 10, "the view from above")
    origin, robot = axes()
    # That of the origin points to the right; that of the robot, which is turned, upwards.
    assert origin[2] > 3 * origin[3]
    assert robot[3] > 3 * robot[2]
    box = beside.tab.locator("canvas").first.bounding_box()
    focal = 0.5 * box["height"] / math.tan(math.radians(37.5))
    camera = np.array([1.0, 2.0, 0.2 + math.hypot(2.1, 2.1) * math.sqrt(0.86)])
    places = [(0, 0, 0), origin[:2]], [(2, 1, 0.5), (robot[0], robot[1] + robot[3])]
    for place, (left, top) in places:
        x, y, z = place - camera
        expected = 0.5 * box["width"] - focal * x / z, 0.5 * box["height"] + focal * y / z - 190
        np.testing.assert_allclose((left, top), expected, atol=12)
    beside.click(0.5, 0.5)
    beside.wait_for(lambda: beside.values().get("cell") == "10, 10", "the middle")
    for right, up in ((1, 0), (0, 1)):
        beside.click(0.5 + 0.05 * right, 0.5 - 0.05 * up)
        expected = 10 - right, 10 - up

        def is_beside(expected: tuple[int, int] = expected) -> bool:
            row, column = map(int, beside.values()["cell"].split(", "))
            return (row < 10, column < 10) == (expected[0] < 10, expected[1] < 10)

        beside.wait_for(is_beside, "a cell to the right, and one above")


def test_path_is_drawn_on_the_surface_of_its_frame(page, node, peer):
    def pink() -> int:
        red, green, blue = np.moveaxis(page.picture().astype(int), -1, 0)
        return int(((red > 200) & (green < 80) & (blue > 130)).sum())

    path = PathMessage(header=Header(frame_id="odom"))
    for x in np.linspace(0.3, 1.7, 15):
        path.poses.append(PoseStamped())
        # Far below the surface, where it could not be seen.
        path.poses[-1].pose.position = Point(x=x, y=2.0, z=-1.0)
    before = pink()  # the dot of a selected cell
    assert before < 50
    peer.publish("/plan", path)
    page.wait_for(lambda: pink() > 200, "the path")
    path.header.frame_id = "map"
    peer.publish("/plan", path)
    page.wait_for(lambda: pink() <= before, "no path")
    text = (
        "dropped a message of /plan: header.frame_id: expected 'odom', that of the map, got 'map'"
    )
    peer.wait_until(lambda: text in node.text, text)


def triangle(x: float, *colors: tuple[float, float, float], number: int = 1) -> Marker:
    """Return a marker that covers a quarter of the map, near `x`."""
    marker = Marker(header=Header(frame_id="odom"), id=number, type=Marker.TRIANGLE_LIST)
    corners = (-0.4, 1.2), (0.4, 1.2), (0.0, 2.8)
    marker.points = [Point(x=x + dx, y=y, z=0.5) for dx, y in corners]
    marker.colors = [ColorRGBA(r=r, g=g, b=b, a=1.0) for r, g, b in colors for _ in range(3)]
    marker.color.a = marker.color.b = 1.0
    return marker


def test_markers_are_drawn_until_they_are_deleted(page, node, peer):
    red, blue = on_screen(np.array([(255, 0, 0), (0, 0, 255)], np.uint8)).tolist()

    def shows(color: list[int]) -> bool:
        return bool(share(page.picture(), tuple(color)) > 0.02)

    def publish(*markers: Marker) -> None:
        peer.publish("/planar_regions", MarkerArray(markers=markers))

    publish(triangle(0.6, (1.0, 0.0, 0.0)), triangle(1.4, number=2))
    page.wait_for(lambda: shows(red) and shows(blue), "two triangles")
    publish(Marker(action=Marker.DELETE, id=1))
    page.wait_for(lambda: not shows(red), "no red triangle")
    publish(Marker(type=Marker.CUBE))
    text = "dropped a message of /planar_regions: markers[0].type: expected 4 (line strip), 5 "
    wait_until(lambda: text in node.text, "the shape")
    assert shows(blue)
    other = triangle(1.4, number=2)
    other.header.frame_id = "map"
    publish(other)
    page.wait_for(lambda: not shows(blue), "no triangle")
    text = "markers.header.frame_id: expected 'odom', that of the map, got 'map'"
    wait_until(lambda: text in node.text, "the frame")


def test_axes_and_frames_are_switched_in_all_browsers(page, beside):
    def gray() -> float:
        """Return the part of the picture that is gray, as lines of the axes are, also blurred."""
        levels = beside.picture().astype(int)
        is_gray = (np.ptp(levels, axis=-1) < 10) & (abs(levels.mean(axis=-1) - 145) < 60)
        return float(is_gray.mean())

    before = gray()
    assert is_red(beside.picture()).any()
    page.control("Axes").uncheck()
    beside.wait_for(lambda: gray() < 0.5 * before, "no axes")
    page.control("Frames").uncheck()
    beside.wait_for(lambda: not is_red(beside.picture()).any(), "no frames")
    page.control("Frames").check()
    beside.wait_for(lambda: is_red(beside.picture()).any(), "frames")
    assert gray() < 0.5 * before
    page.control("Axes").check()
    beside.wait_for(lambda: gray() > 0.8 * before, "axes")


def test_dark_page_is_dark(page, beside):
    def light_of_background() -> float:
        return float(beside.picture()[:100, -100:].mean())

    page.control("Dark").check()
    beside.wait_for(lambda: light_of_background() < 50, "a dark background")
    page.control("Dark").uncheck()
    beside.wait_for(lambda: light_of_background() > 200, "a light background")


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (900, 640)])
def test_long_cell_list_leaves_the_legend_in_sight(beside, publish, width, height):
    beside.tab.set_viewport_size({"width": width, "height": height})
    publish(slope(**{f"layer {k}": float(k) for k in range(60)}))
    beside.click(0.6, 0.5)
    beside.wait_for(lambda: beside.values().get("layer 59") == "59", "the cell")
    table = beside.tab.locator("table")
    shown = beside.tab.locator("b"), table.last.locator("td").first, table.first

    def are_in_sight() -> bool:
        boxes = [one.bounding_box() for one in shown]
        ends = [box and (box["x"] + box["width"], box["y"] + box["height"]) for box in boxes]
        return all(end and end[0] <= width and end[1] <= height for end in ends)

    # The list rises from the lower border.
    beside.wait_for(are_in_sight, "legend and lists")
    publish(slope())


def test_topic_is_chosen_on_the_page(page, node, peer):
    other = slope()
    other.frame_id = "other"
    peer.listen("/filtered", GridMapMessage)
    publisher = peer.node.create_publisher(GridMapMessage, "/filtered", map_qos())
    publisher.publish(to_message(other))
    page.control("Topic").click()
    page.tab.get_by_role("option", name="/filtered", exact=True).click()
    page.wait_for(lambda: page.values().get("Frame") == "other", "the other map")
    assert "shows /filtered in the browser" in node.text
    peer.wait_until(lambda: not peer.node.count_subscribers("/grid_map"), "no subscriber")
    page.choose("Topic", "/grid_map")
    page.wait_for(lambda: page.values().get("Frame") == "odom", "the first map")
    peer.node.destroy_publisher(publisher)


def test_view_follows_a_map_that_left_it(page, publish):
    far, here = slope(), slope()
    far.position, far.frame_id = (100.0, -40.0), "far"
    for grid_map in (far, here):
        publish(grid_map)
        frame = grid_map.frame_id
        page.wait_for(lambda name=frame: page.values().get("Frame") == name, "the map")
        middle = pytest.approx(grid_map.position, abs=0.05)

        def is_in_view(middle: object = middle) -> bool:
            # The view moves a moment after the text.
            page.click(0.5, 0.5)
            return page.place() == middle

        page.wait_for(is_in_view, "the middle of the map")


def test_overlays_and_history_are_shown(page, publish):
    publish(slope(normal_x=0.0, normal_y=0.0, normal_z=1.0))
    history = page.tab.get_by_role("slider").nth(2)
    # When the next change is seen, the node knows this one.
    history.press("ArrowRight")
    page.change_picture(lambda: page.control("Grid lines").check())
    page.change_picture(lambda: page.control("Points").check())
    page.change_picture(lambda: page.choose("Vectors", "normal_"))
    # An older map lies beside the new one.
    moved = slope()
    moved.position = (3.5, 2.0)
    page.change_picture(lambda: publish(moved))
    page.wait_for_colors(*VIRIDIS)
    page.tab.screenshot(path=PICTURES / "web_viewer_overlays.png")
    page.change_picture(lambda: history.press("ArrowLeft"))
    page.change_picture(lambda: page.control("Grid lines").uncheck())
    page.change_picture(lambda: page.control("Points").uncheck())
    publish(slope())


def test_the_choice_of_layers_follows_the_maps(page, publish):
    grid_map = slope(rough=1.0)
    publish(grid_map)
    # The selected layer stays selected while it exists.
    page.choose("Layer", "rough")
    grid_map["new"] = 2.0
    publish(grid_map)
    page.control("Layer").click()
    page.tab.get_by_role("option", name="new", exact=True).wait_for()
    page.tab.keyboard.press("Escape")
    assert page.control("Layer").input_value() == "rough"
    publish(slope())
    page.wait_for(lambda: page.control("Layer").input_value() == "elevation", "another layer")
    page.wait_for(lambda: page.legend_title() == "elevation [m]", "the unit")
    page.choose("Layer", "side")
    page.wait_for_colors(*VIRIDIS)


def test_page_names_an_invalid_map_and_keeps_the_last(page, publish, peer):
    message = to_message(slope())
    message.info.resolution = -1.0
    peer.publish("/grid_map", message)
    page.tab.get_by_text("info.resolution: expected a positive").wait_for()
    page.wait_for_colors(*VIRIDIS)
    page.click(0.5, 0.5)
    page.wait_for(lambda: page.values().get("cell") == "10, 10", "the readout of the last one")
    publish(slope())
    page.wait_for(lambda: "Frame" in page.values(), "the next map")


def test_a_paused_page_keeps_its_map(page, publish):
    page.control("Pause").check()
    silence = lambda: int(re.match(r"\d+(?= s ago, paused)", page.values()["Last map"])[0])  # noqa: E731
    page.wait_for(lambda: "paused" in page.values()["Last map"] and silence() > 4, "the pause")
    later = GridMap((2.1, 2.1), 0.1, layers={"elevation": 0.0, "side": 0.0}, frame_id="later")

    def is_heard() -> bool:
        publish(later)
        return silence() < 4

    page.wait_for(is_heard, "the map")
    assert page.values()["Frame"] == "odom"
    page.control("Pause").uncheck()
    page.wait_for(lambda: page.values()["Frame"] == "later", "the latest map")
    publish(slope())
    page.wait_for(lambda: page.values()["Frame"] == "odom", "the next map")


def test_a_screenshot_is_downloaded(page):
    with page.tab.expect_download() as download:
        page.tab.get_by_role("button", name="Screenshot").click()
    assert download.value.suggested_filename == "grid_map.png"
    picture = decoded(Path(download.value.path()).read_bytes())
    assert all(share(picture, color) > 0.02 for color in (*VIRIDIS, (255, 255, 255)))


def test_page_says_that_a_large_map_is_thinned(page, publish):
    large = GridMap((40.0, 20.0), 0.1, layers={"elevation": 1.0, "side": 0.0})
    large["side"][100, 50:52] = 7.25
    publish(large)
    thinned = re.compile(r"(\d+) x (\d+) of 400 x 200")
    page.wait_for(lambda: thinned.match(page.values()["Cells"]), "the large map")
    rows, columns = thinned.match(page.values()["Cells"]).groups()
    assert 1000 < int(rows) * int(columns) <= MAX_CELLS
    # Between the cells that are shown.
    assert page.tab.get_by_text("7.25", exact=True).is_visible()
    publish(slope())


def status(url: str, **headers: str) -> int:
    """Return the status of an answer: 101 if a websocket is open, 200 for a file."""
    connection = HTTPConnection(urlsplit(url).netloc, timeout=PATIENCE)
    connection.request("GET", "/", headers=headers)
    return connection.getresponse().status


WEBSOCKET = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
}
"""Headers of a request for a websocket."""

CONNECT = """async url => await new Promise(resolve => {
    const socket = new WebSocket(url);
    socket.onopen = () => { socket.close(); resolve("open"); };
    socket.onerror = () => resolve("refused");
})"""
FETCH = "url => fetch(url).then(answer => answer.text(), () => 'refused')"


def test_foreign_pages_cannot_connect(chromium, page, node):
    url = url_of(node)
    for headers, answer in (({}, 200), (WEBSOCKET, 101)):
        assert status(url, **headers) == status(url, **headers, Origin=url) == answer
        # A foreign page, and a foreign name that points to this machine.
        evil = {**headers, "Origin": "http://evil.example"}
        assert status(url, **evil) == status(url, **evil, Host="evil.example") == 403
        assert status(url, **headers, Host="evil.example") == 403
    with http.server.ThreadingHTTPServer(
        ("127.0.0.1", 0), http.server.SimpleHTTPRequestHandler
    ) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        foreign = chromium.new_page()
        foreign.goto(f"http://127.0.0.1:{server.server_port}")
        assert foreign.evaluate(FETCH, url) == "refused"
        target = url.replace("http", "ws")
        assert foreign.evaluate(CONNECT, target) == "refused"
        assert page.tab.evaluate(CONNECT, target) == "open"
        foreign.close()
        server.shutdown()


def test_page_continues_after_node_and_publisher_restart(chromium):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    # On the default topic, maps of other tests are still available.
    topic = "/ground"
    settings = {"host": "0.0.0.0", "port": port, "color_layer": "side", "grid_map_topic": topic}
    browser = Browser(chromium.new_page(viewport=VIEWPORT))
    with testing.peer() as first, running(start_viewer(**settings)) as node:
        first.publish(topic, to_message(slope()))
        assert url_of(node).endswith(f":{port}")
        warning = node.lines[0]
        assert "[WARN]" in warning
        assert "anyone who can reach http://" in warning
        browser.tab.goto(f"http://127.0.0.1:{port}")
        browser.wait_for(lambda: browser.values().get("Frame") == "odom", "the map")
    with running(start_viewer(color_map="coolwarm", **settings)):
        with testing.peer() as second:
            second.publish(topic, to_message(slope()))
            is_new = lambda: browser.control("Color map").input_value() == "coolwarm"  # noqa: E731
            browser.wait_for(is_new, "the page of the second node")
            browser.open_folders()
            browser.control("Shaded").set_checked(False)
            browser.wait_for_colors(*COOLWARM)
        with testing.peer() as third:
            grid_map = slope()
            grid_map.frame_id = "third"
            third.publish(topic, to_message(grid_map))
            browser.wait_for(lambda: browser.values()["Frame"] == "third", "the map")
        browser.tab.close()
