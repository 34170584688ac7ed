# SPDX-License-Identifier: BSD-3-Clause
"""A bag in `grid-map view`, seen in headless Chromium; Rerun draws its page on a canvas."""

import signal
import sys
from collections.abc import Callable, Iterator

import cv2
import numpy as np
import pytest
from test_node_web_viewer import CHROMIUM, FLAGS, PATIENCE, PICTURES, decoded, share

from grid_map_core_py import GridMap
from grid_map_ros_py import save_to_bag
from grid_map_ros_py.testing import Process, wait_until

pytestmark = [
    pytest.mark.needs("matplotlib", "mcap", "playwright", "rerun"),
    pytest.mark.timeout(300),
]

VIEWPORT = {"width": 1000, "height": 640}
DARK, BRIGHT = (0x44, 0x01, 0x54), (0xFD, 0xE7, 0x25)
"""Colors at the ends of the color map viridis."""

SURFACE, LEGEND = np.s_[70:540, :590], np.s_[550:615, :590]
"""Parts of a picture of the page (rows, columns)."""

ELEVATION, CONSTANT, ELSEWHERE = (620, 160), (820, 160), (620, 260)
"""Places in the images of these layers (right, down); the first is in cell (18, 3)."""

NUMBER = np.s_[243:263, 862:908]
"""Part of a picture with the value, while the pointer is at `ELEVATION`."""

CORNER = 315, 605
"""Row and column of a picture with the corner of `elevation` at the smallest x and y."""

START = 292, 626
"""Place of the left end of the timeline."""


def write_bag() -> None:
    """Write two maps; the layer `constant` has the value of one cell of `elevation` everywhere."""

    def ramp(second: int) -> GridMap:
        options = {"frame_id": "map", "timestamp": 1_700_000_000_000_000_000 + second * 10**9}
        grid_map = GridMap((2.0, 2.0), 0.1, layers={"elevation": 0.0}, **options)
        x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
        grid_map["elevation"] = (0.31 * x + 0.17 * y) * (1 - 2 * second)
        grid_map["constant"] = grid_map["elevation"][18, 3]
        return grid_map

    save_to_bag((ramp(second) for second in (0, 1)), "survey", "/grid_map")


class Page:
    """The page of Rerun in a tab."""

    def __init__(self, tab: object) -> None:
        self.tab = tab

    def picture(self) -> np.ndarray:
        """Return a picture of the page, (rows, columns, 3) red, green, blue."""
        return decoded(self.tab.screenshot(timeout=1e3 * PATIENCE))

    def wait_for(self, condition: Callable[[np.ndarray], object], what: str) -> np.ndarray:
        """Return the first picture for which the condition holds."""
        pictures = []

        def holds() -> bool:
            pictures.append(self.picture())
            return bool(condition(pictures[-1]))

        try:
            step = lambda: self.tab.wait_for_timeout(200)  # noqa: E731
            wait_until(holds, what, step=step, timeout=PATIENCE)
        except AssertionError:
            PICTURES.mkdir(exist_ok=True)
            cv2.imwrite(str(PICTURES / "rerun_failed.png"), pictures[-1][..., ::-1])
            raise
        return pictures[-1]


def is_like(pixel: np.ndarray, color: tuple[int, int, int]) -> bool:
    return bool((np.abs(pixel.astype(int) - color) < 30).all())


def has_text(box: np.ndarray) -> bool:
    """Return whether a part of a picture is white with something dark in it."""
    return bool((box > 240).mean() > 0.5 and (box < 100).any())


def likeness(picture: np.ndarray, box: np.ndarray) -> float:
    found = cv2.matchTemplate(picture, np.ascontiguousarray(box), cv2.TM_CCOEFF_NORMED)
    return float(found.max())


@pytest.fixture
def page(tmp_path, monkeypatch) -> Iterator[Page]:
    playwright = pytest.importorskip("playwright.sync_api")
    monkeypatch.chdir(tmp_path)
    write_bag()
    command = [sys.executable, "-m", "grid_map_core_py", "view", "survey", "--port", "0"]
    process = Process(command)
    try:
        wait_until(lambda: process.lines, "the address", timeout=PATIENCE)
        with playwright.sync_playwright() as driver:
            browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            tab = browser.new_page(viewport=VIEWPORT)
            address = f"{process.lines[0].strip()}/?renderer=webgl&theme=light"
            tab.goto(address, timeout=1e3 * PATIENCE)
            yield Page(tab)
            browser.close()
        process.send_signal(signal.SIGINT)
        assert process.wait() == 0, process.text
    finally:
        process.stop()


def test_page_shows_surface_legend_value_and_both_times(page):
    def is_drawn(picture: np.ndarray) -> bool:
        parts = (picture[LEGEND], 12), (picture[SURFACE], 40)
        return all(share(part, end, off) > 0.0003 for part, off in parts for end in (DARK, BRIGHT))

    page.wait_for(is_drawn, "the legend and the surface")
    # The other layer has this value in all cells, so the page must write the same number there.
    page.tab.mouse.move(*ELEVATION)
    box = page.wait_for(lambda picture: has_text(picture[NUMBER]), "the value")[NUMBER]
    page.tab.mouse.move(*ELSEWHERE)
    page.wait_for(lambda picture: likeness(picture, box) < 0.8, "another value")
    page.tab.mouse.move(*CONSTANT)
    page.wait_for(lambda picture: likeness(picture, box) > 0.85, "the same value")
    # Each map has another end of the colors there.
    page.tab.mouse.click(*START)
    page.wait_for(lambda picture: is_like(picture[CORNER], DARK), "the first map")
    page.tab.keyboard.press("Shift+ArrowRight")
    page.wait_for(lambda picture: is_like(picture[CORNER], BRIGHT), "the next map")
