# SPDX-License-Identifier: BSD-3-Clause
"""Draw the pictures of both viewers: their pages with the filtered terrain, in Chromium.

    python3 docs/images/make_viewer_pictures.py [FOLDER]

writes `rerun.png` and `web_viewer.png` into the folder, `docs/images/viewers` by default.
"""

import shutil
import sys
import time
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from grid_map_core_py import GridMap
from grid_map_demos_py.terrain import load_terrain
from grid_map_filters_py import FilterChain
from grid_map_ros_py import save_to_bag, to_message
from grid_map_ros_py.testing import Process, peer, wait_until

FOLDER = Path(__file__).parent / "viewers"
DEMOS = Path(__file__).parents[2] / "grid_map_demos_py"
CHAIN = DEMOS / "config" / "filters_demo_filter_chain.yaml"
TERRAIN = DEMOS / "data" / "jacksboro_fault_dem.npz"
LAYERS = "elevation", "elevation_inpainted", "normal_color", "slope", "roughness", "traversability"
HEIGHTS = "elevation_inpainted"
SIZE = {"width": 1200, "height": 720}
SCENE = 0, 0, 700, 720
"""Left, top, right and bottom of the surface in both pages."""

CELL = 480, 450
"""Place whose values the page of `web_viewer` shows (right, down)."""

COLORS = 256
"""A palette makes the file three times smaller."""

FLAGS = "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)


def seen(
    tab: Any, process: Process, options: str, path: Path, clicked: tuple[int, int] | None = None
) -> None:
    """Save a picture of the page of a process once it stands still."""

    def address() -> list[str]:
        return [line.strip() for line in process.lines if line.startswith("http://")]

    wait_until(address, "the address")
    tab.goto(address()[0] + options, timeout=100_000)
    pictures = [Image.new("RGB", (1, 1))] * 2

    def stands_still() -> bool:
        # The page of `web_viewer` warns of slow graphics.
        for notice in tab.get_by_role("alert").get_by_role("button").all():
            notice.click()
        if clicked:
            tab.mouse.click(*clicked)
        png = tab.screenshot(timeout=100_000)
        pictures.append(Image.open(BytesIO(png)).convert("RGB"))
        # A page that loads is almost empty; beside the scene, the age of the map may change.
        scenes = [picture.crop(SCENE).tobytes() for picture in pictures[-2:]]
        return len(png) > 60_000 and scenes[0] == scenes[1]

    step = lambda: tab.wait_for_timeout(2000)  # noqa: E731
    wait_until(stands_still, "the page", step=step, timeout=100)
    picture = pictures[-1].quantize(COLORS, dither=Image.Dither.NONE)
    picture.save(path, optimize=True)


def rerun(tab: Any, terrain: GridMap, folder: Path) -> None:
    """Draw the page of `grid-map view`, with four maps at one second each."""
    maps = [terrain.copy() for _ in range(4)]
    for second, one in enumerate(maps):
        one.timestamp = (1_700_000_000 + second) * 10**9
    with TemporaryDirectory() as scratch:
        bag = str(Path(scratch) / "survey")
        save_to_bag(maps, bag, "/filtered_map")
        layers = "--layer", HEIGHTS, "--color-layer", "traversability"
        view = "-m", "grid_map_core_py", "view", bag, *layers, "--port", "0"
        process = Process([sys.executable, *view])
        try:
            seen(tab, process, "/?renderer=webgl&theme=light", folder / "rerun.png")
        finally:
            process.stop()


def web_viewer(tab: Any, terrain: GridMap, folder: Path) -> None:
    """Draw the page of `web_viewer`."""
    module = "grid_map_visualization_py._executables.web_viewer"
    layers = f"height_layer:={HEIGHTS}", "color_layer:=traversability"
    given = "port:=0", "grid_map_topic:=/filtered_map", *layers
    # The page shows the age of the map.
    terrain.timestamp = time.time_ns()
    words = [word for one in given for word in ("-p", one)]
    process = Process([sys.executable, "-m", module, "--ros-args", *words])
    try:
        with peer() as publisher:
            publisher.publish("/filtered_map", to_message(terrain))
            seen(tab, process, "", folder / "web_viewer.png", CELL)
    finally:
        process.stop()


def main(folder: Path) -> None:
    """Draw both pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    terrain = FilterChain.from_yaml(CHAIN)(load_terrain(TERRAIN))
    terrain.timestamp = 1_700_000_000 * 10**9
    terrain = terrain.without_layers([name for name in terrain.layers if name not in LAYERS])
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        for draw in rerun, web_viewer:
            draw(browser.new_page(viewport=SIZE), terrain, folder)
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
