# SPDX-License-Identifier: BSD-3-Clause
"""The image demos, without ROS running."""

import math
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from demos import DATA, PACKAGE

from grid_map_core_py.conversions import to_image
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files._image_files import read_image
from grid_map_demos_py.grid_map_to_image_demo_node import keeps
from grid_map_demos_py.image_publisher_node import read_message
from grid_map_demos_py.opencv_demo_node import blur, kernel_size
from grid_map_demos_py.parts import VERTICES, star_map, weighted_means
from grid_map_demos_py.resolution_change_demo_node import resolution_at
from grid_map_ros_py.messages._image import to_pixels
from grid_map_ros_py.testing import Process

# --- from files to messages -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("encoding", "kind", "channels"),
    [
        *(("mono8", "uint8", 1), ("bgr8", "uint8", 3), ("bgra8", "uint8", 4)),
        *(("mono16", "uint16", 1), ("bgr16", "uint16", 3), ("bgra16", "uint16", 4)),
        *(("32FC1", "float32", 1), ("32FC3", "float32", 3)),
    ],
)
def test_message_has_the_pixels_of_the_file(encoding, kind, channels, tmp_path):
    file = str(tmp_path / ("image.tiff" if kind == "float32" else "image.png"))
    written = np.random.default_rng(1).integers(-(2**15), 2**15, (2, 3, channels)).astype(kind)
    # Uncompressed, because older versions of OpenCV compress colors with loss.
    assert cv2.imwrite(file, written, [cv2.IMWRITE_TIFF_COMPRESSION, 1])
    message = read_message(Path(file))
    assert (message.encoding, message.height, message.width) == (encoding, 2, 3)
    pixels, order = to_pixels(message)
    assert order == "bgr"
    np.testing.assert_array_equal(pixels, written)


def test_error_names_image_that_is_too_large(tmp_path):
    file = tmp_path / "image.pgm"
    file.write_bytes(b"P5 100000 100000 255\ntoo many pixels")
    with pytest.raises(GridMapError, match=rf"{file}: .*at most 16000000 cells"):
        read_message(file)


# --- from maps to files ---------------------------------------------------------------------------


LOSSLESS = [(8, False, "png"), (8, False, "PNG"), (8, False, "jpg"), (16, True, "png")]
LOSSLESS += [(16, False, "tiff")]
LOSSY = [(16, False, "jpg"), (8, True, "jpg"), (16, False, "gif"), (8, False, "doc")]


@pytest.mark.parametrize(("bits", "transparent", "ending"), LOSSLESS + LOSSY)
@pytest.mark.parametrize("is_color", [False, True])
def test_lossy_formats_do_not_fit(bits, transparent, ending, is_color):
    shape = (1, 1, 4) if transparent else (1, 1, 3) if is_color else (1, 1)
    path = Path("folder") / f"image.{ending}"
    fits = (bits, transparent, ending) in LOSSLESS
    assert keeps(path, np.zeros(shape, f"uint{bits}")) == fits


# --- the star -------------------------------------------------------------------------------------


def test_the_star_covers_its_polygon_and_nothing_else():
    grid_map = star_map("elevation", 0.01)
    x, y = np.transpose(VERTICES)
    area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    is_star = grid_map["elevation"] > 0.0
    assert {*np.unique(grid_map["elevation"])} == {np.float32(0.0), np.float32(0.3)}
    assert is_star.sum() * 0.01**2 == pytest.approx(area, rel=0.01)
    for position, expected in {(0.45, 0): 1, (-0.45, 0): 0, (-0.45, 0.37): 1}.items():
        assert is_star[grid_map.get_index(position)] == expected, position
    without_ground = star_map("elevation", 0.01, has_ground=False)
    np.testing.assert_array_equal(np.isfinite(without_ground["elevation"]), is_star)


def test_kernel_size_is_odd_between_1_and_201():
    sizes = [kernel_size(seconds) for seconds in np.linspace(0.0, math.pi, 101)]
    assert all(size % 2 == 1 for size in sizes)
    assert (sizes[0], sizes[50]) == (201, 1)
    assert sizes[-1] in (199, 201)
    assert sizes[:51] == sorted(sizes[:51], reverse=True)
    assert sizes[50:] == sorted(sizes[50:])


def gaussian(image: np.ndarray, size: int) -> np.ndarray:
    """Blur (rows, cols) along both axes, mirrored at the border, with OpenCV's rule for sigma."""
    sigma = 0.3 * ((size - 1) * 0.5 - 1) + 0.8
    offsets = np.arange(size) - size // 2
    kernel = np.exp(-(offsets**2) / (2 * sigma**2))
    kernel /= kernel.sum()
    for _ in range(2):
        padded = np.pad(image, ((size // 2, size // 2), (0, 0)), "reflect")
        image = sum(w * padded[k : k + len(image)] for k, w in enumerate(kernel)).T
    return image


@pytest.mark.parametrize("size", [1, 21, 201])
def test_blur_is_gaussian_also_with_transparency(size):
    grid_map = star_map("original", 0.01)
    blur(grid_map, to_image(grid_map, "original", np.uint16, 1, 0.0, 0.3), size)
    expected = gaussian(grid_map["original"].astype(np.float64), size)
    np.testing.assert_allclose(grid_map["elevation"], expected, atol=2e-4)
    grid_map = star_map("original", 0.01, has_ground=False)
    blur(grid_map, to_image(grid_map, "original", np.uint16, 4, 0.0, 0.3), size)
    opacity = gaussian(np.isfinite(grid_map["original"]).astype(np.float64), size)
    # Where the opacity is close to the threshold, rounding decides.
    clear = np.abs(opacity - 0.3) > 1e-3
    assert clear.mean() > 0.98
    expected = np.where(opacity < 0.3, np.nan, 0.3 * opacity)
    np.testing.assert_allclose(grid_map["elevation"][clear], expected[clear], atol=2e-4)


def test_cells_grow_and_shrink_between_1_cm_and_9_cm():
    seconds = np.linspace(0.0, 2 * math.pi, 1001)
    sides = [resolution_at(second) for second in seconds]
    assert min(sides) == pytest.approx(0.01)
    assert max(sides) == pytest.approx(0.09)


@pytest.mark.parametrize("radius", [0.01, 0.05, 0.1])
def test_mean_weighs_finite_neighbors_by_distance(radius):
    random = np.random.default_rng(5)
    layer = random.uniform(size=(9, 11))
    layer[random.uniform(size=layer.shape) < 0.3] = np.inf
    layer[:4, :4] = np.inf
    means = weighted_means(layer, radius, 0.02)
    for row, column in np.ndindex(layer.shape):
        total, weights = 0.0, 0.0
        for other_row, other_column in np.ndindex(layer.shape):
            distance = 0.02 * np.hypot(row - other_row, column - other_column)
            if distance < radius and np.isfinite(layer[other_row, other_column]):
                total += (radius - distance) ** 2 * layer[other_row, other_column]
                weights += (radius - distance) ** 2
        expected = total / weights if weights else np.nan
        np.testing.assert_allclose(means[row, column], expected, rtol=1e-9)
    assert np.isnan(means).any() == (radius < 0.1)


# --- data -----------------------------------------------------------------------------------------


def test_data_files_equal_the_output_of_their_script(tmp_path):
    made = tmp_path / "data"
    done = Process([sys.executable, str(PACKAGE / "scripts" / "make_data.py"), str(made)])
    assert done.wait() == 0, done.text
    assert {path.name for path in made.iterdir()} == {"terrain.png", "terrain_16bit.png", "room.bt"}
    for path in made.iterdir():
        stored = DATA / path.name
        if path.suffix == ".bt":
            assert path.read_bytes() == stored.read_bytes()
        else:
            # Versions of OpenCV may round in different ways.
            new, old = (read_image(file).astype(int) for file in (path, stored))
            np.testing.assert_allclose(new, old, atol=np.iinfo(read_image(path).dtype).max // 48)
