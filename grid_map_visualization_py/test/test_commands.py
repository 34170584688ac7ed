# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map plot`."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_core_py.files import save_npz
from grid_map_ros_py import save_to_bag
from grid_map_ros_py.bags import BagWriter


@pytest.fixture
def command(grid_map_command):
    """Return `grid_map_command` in a folder with maps."""
    grid_map = GridMap((0.8, 0.6), 0.1, layers=("elevation", "slope", "color"), frame_id="odom")
    grid_map["elevation"] = np.arange(48.0).reshape(8, 6)
    grid_map["elevation"][2, 3:5] = np.nan
    grid_map["slope"] = 0.5
    grid_map["color"] = np.array(0x00FF8000, np.uint32).view(np.float32)
    save_npz(grid_map, "site.npz")
    save_to_bag(grid_map, "survey", "/grid_map")
    return grid_map_command


@pytest.mark.parametrize(
    "options",
    [
        "--layer slope --hillshade elevation --lower -1 --upper 3 --invert",
        "--3d --color-layer slope --exaggeration 0.1 --max-drawn-cells 9",
        "--relief --color-map terrain --title Here",
        "--layer color --no-hillshade --max-drawn-cells 9",
    ],
)
def test_pictures_show_the_map(options, command):
    code, text, error = command(f"plot site.npz map.png {options}")
    assert (code, text, error) == (0, "", "grid-map: map.png is drawn\n")
    picture = cv2.imread("map.png")
    assert min(picture.shape[:2]) > 300
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 20
    if "--layer" in options:
        assert picture.shape[:2] == (770, 990)


def test_path_draws_the_path_on_the_layer(command):
    line = "path site.npz 0.3,-0.1 -0.3,0.1 --cost slope --output path.png"
    code, text, error = command(line)
    assert (code, error) == (0, "grid-map: path.png is drawn\n")
    assert text.startswith("length  0.632456 m\n")
    red = (cv2.imread("path.png") == (0, 0, 255)).all(axis=2)
    assert command(line)[2].endswith("path.png: already exists; --force replaces it\n")
    command("plot site.npz map.png --layer slope")
    assert not (cv2.imread("map.png") == (0, 0, 255)).all(axis=2).any()
    # The path leads from the lower right to the upper left.
    rows, columns = np.nonzero(red)
    assert np.corrcoef(rows, columns)[0, 1] > 0.9


@pytest.mark.needs("xarray", "zarr", "dask")
def test_plot_thins_maps_larger_than_memory(command):
    from grid_map_core_py.map import GridGeometry
    from grid_map_core_py.tiled import TiledMap

    geometry = GridGeometry.from_size((8_000, 3_000), 0.1)
    site = TiledMap.create("huge.zarr", geometry, ["elevation", "slope"])
    x = np.linspace(0, 30, 3000)
    values = np.sin(x)[:, None] * np.cos(x)
    site.write(GridMap((300, 300), 0.1, layers={"slope": values}))
    code, text, error = command("plot huge.zarr map.png --layer slope")
    assert (code, text, error) == (0, "", "grid-map: map.png is drawn\n")
    assert len(np.unique(cv2.imread("map.png").reshape(-1, 3), axis=0)) > 20


def test_bag_becomes_an_animation(command):
    with BagWriter("many") as bag:
        for number in range(3):
            grid_map = GridMap((0.8, 0.6), 0.1, layers={"elevation": number})
            bag.write("/grid_map", grid_map, time=number * 10**9)
    code, text, error = command("plot many map.mp4 --speed 2 --dpi 40 --lower 0")
    assert (code, text, error.splitlines()[-1]) == (0, "", "grid-map: map.mp4 is drawn")
    video = cv2.VideoCapture("map.mp4")
    assert [video.read()[0] for _ in range(4)] == [True, True, True, False]
    assert command("plot many map.mp4")[0] == 1


@pytest.mark.parametrize(
    ("line", "code", "text"),
    [
        ("plot site.npz map.bmp", 2, "expected a name that ends in .jpg, .pdf, .png, .svg, .gif"),
        ("plot site.npz map.png --layer hight", 1, "no layer 'hight'; available: elevation"),
        ("plot site.npz map.png --dpi 5000", 2, "--dpi: expected a number from 10 to 1200"),
        ("plot site.npz map.png --lower -1e-3 --upper -inf", 1, "'upper': expected a finite"),
        ("plot site.npz map.png --relief --max-drawn-cells 9", 2, "goes without --relief only"),
        ("plot site.npz map.png --color-layer a", 2, "--color-layer goes with --3d or --relief"),
        ("plot site.npz map.png --3d --hillshade slope", 2, "--hillshade goes without --3d"),
        ("plot site.npz map.gif", 1, "site.npz: expected a bag, which holds many maps"),
        ("plot survey map.gif --3d", 2, "--3d and --relief are for pictures"),
        ("plot survey map.mp4 --index 0", 2, "--index is for pictures"),
        ("plot survey map.png --speed 2", 2, "--speed is for .gif and .mp4"),
        ("plot survey nowhere/map.mp4", 1, "nowhere/map.mp4: cannot be written: there is no fol"),
        ("plot site.npz nowhere/map.png", 1, "nowhere/map.png: cannot be written: there is no fol"),
        ("plot survey map.png --topic /other", 1, "/grid_map"),
    ],
)
def test_mistakes_are_one_line(line, code, text, refused):
    found, error = refused(line)
    assert (found, text in error) == (code, True), error
    assert not Path("map.png").exists()


def test_only_force_replaces_a_picture(command):
    Path("map.png").write_text("old")
    assert command("plot site.npz map.png")[0] == 1
    assert Path("map.png").read_text() == "old"
    assert command("plot site.npz map.png --force")[0] == 0
    assert cv2.imread("map.png") is not None


def test_error_without_matplotlib_says_how_to_install_it(command):
    code = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "from grid_map_core_py._commands import main\nsys.exit(main(sys.argv[1:]))"
    )
    assert command("--version")[0] == 0
    words = [sys.executable, "-c", code, "plot", "site.npz", "map.png"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "needs the package 'matplotlib', which is not installed: " in done.stderr
