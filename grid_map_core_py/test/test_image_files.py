# SPDX-License-Identifier: BSD-3-Clause
"""Height maps as images."""

import cv2
import numpy as np
import pytest

from grid_map_core_py import GridMap, LayerNotFoundError
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import load, load_height_image, save, save_height_image
from grid_map_core_py.testing import moved_in_buffer


def hills(holes: bool = True) -> GridMap:
    """Return a moved map of heights from -2 to 3 m."""
    grid_map = GridMap((0.8, 0.6), 0.1, layers={"elevation": 0.0}, position=(1.0, 2.0))
    grid_map["elevation"] = np.random.default_rng(3).uniform(-2, 3, (8, 6))
    grid_map["elevation"][2, 3] = np.nan if holes else 0.0
    return moved_in_buffer(grid_map, (3, 1))


@pytest.mark.parametrize("holes", [False, True])
@pytest.mark.parametrize(
    ("name", "bits", "step"),
    [
        ("a.png", 8, 5 / 255),
        ("a.png", None, 5 / 65535),
        ("a.tif", 16, 5 / 65535),
        ("a.tiff", 32, 0),
    ],
)
def test_heights_round_trip_within_one_step(tmp_path, name, bits, step, holes):
    path, bounds = tmp_path / name, {"lower": -2.0, "upper": 3.0} if step else {}
    grid_map = hills(holes)
    save(grid_map, path, bits=bits, **bounds)
    place = {"resolution": 0.1, "position": (1.0, 2.0), "frame_id": "odom"}
    again = load(path, format="height_image", **bounds, **place)
    assert (again.layers, again.frame_id) == (("elevation",), "odom")
    assert again.geometry == grid_map.geometry
    np.testing.assert_allclose(
        again["elevation"], grid_map.unwrapped("elevation"), rtol=0, atol=step + 1e-6
    )


@pytest.mark.parametrize(
    ("ending", "dtype"),
    [(".png", np.uint8), (".png", np.uint16), (".tif", np.uint16), (".tif", np.float64)],
)
def test_up_is_y_and_white_is_the_upper_bound(tmp_path, ending, dtype):
    is_integer = np.issubdtype(dtype, np.integer)
    white = np.iinfo(dtype).max if is_integer else 10.0
    image = np.zeros((2, 3), dtype)
    image[0, 2] = white
    path = tmp_path / f"a{ending}"
    cv2.imwrite(str(path), image)
    bounds = {"lower": 5.0, "upper": 10.0} if is_integer else {}
    grid_map = load_height_image(path, resolution=1.0, height_layer="z", **bounds)
    assert grid_map.size == (3, 2)
    assert grid_map.at_position("z", (1.0, 0.5)) == 10.0
    assert (np.sort(grid_map["z"], axis=None)[:-1] == (5.0 if is_integer else 0.0)).all()


def test_missing_and_invalid_parameters_are_named(tmp_path):
    grid_map, png, tif = hills(), tmp_path / "a.png", tmp_path / "a.tif"
    save_height_image(grid_map, png)
    save_height_image(grid_map, tif)
    before = png.read_bytes()
    for path, options, message in (
        (png, {}, "resolution: expected the side of a pixel .* 8 x 6 pixels"),
        (png, {"resolution": -1.0}, "a.png: resolution"),
        (png, {"resolution": 1.0, "lower": np.nan}, "a.png: lower"),
        (tif, {"resolution": 1.0, "upper": 7.0}, "an image of floats holds the heights"),
        (tmp_path / "none.png", {}, "none.png: cannot be read: No such file"),
    ):
        with pytest.raises(GridMapError, match=message):
            load_height_image(path, **options)
    with pytest.raises(LayerNotFoundError, match="'slope'; available: elevation"):
        load_height_image(png, ["slope"], resolution=1.0)
    for path, options, message in (
        (png, {"bits": 32}, r"bits: expected one of 8, 16, got 32"),
        (tif, {"bits": 32, "lower": 0.0}, "an image of float32 holds the heights"),
        (png, {"layer": "slope"}, "no layer 'slope'"),
    ):
        with pytest.raises(GridMapError, match=message):
            save_height_image(grid_map, path, **options)
    assert png.read_bytes() == before


def test_images_say_that_the_reference_system_is_lost(tmp_path):
    grid_map = GridMap((1, 1), 0.5, layers={"elevation": 1.0})
    grid_map.crs = 25832
    for name in ("map.png", "map.yaml"):
        with pytest.warns(UserWarning, match=r"crs: an image cannot hold .*; it is lost\. A GeoT"):
            save(grid_map, tmp_path / name)


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.bmp", "a.pgm"])
def test_a_damaged_image_is_one_error(tmp_path, name):
    path = tmp_path / name
    cv2.imwrite(str(path), np.random.default_rng(1).integers(0, 255, (40, 30), np.uint8))
    data = path.read_bytes()
    for damaged in (b"", b"no image", data[: len(data) // 2]):
        path.write_bytes(damaged)
        with pytest.raises(GridMapError, match=f"{name}: cannot be read: "):
            load_height_image(path, resolution=1.0)
