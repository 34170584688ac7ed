# SPDX-License-Identifier: BSD-3-Clause
"""Maps of nav2's map_server, compared with a slow reader written after its documentation."""

import itertools
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from grid_map_core_py import GridMap, GridMapError, LayerNotFoundError
from grid_map_core_py.files import load, load_map_server, save, save_map_server
from grid_map_core_py.testing import moved_in_buffer

SETTINGS = {
    "image": "map.pgm",
    "mode": "trinary",
    "resolution": 0.5,
    "origin": [-10.0, 4.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.25,
}
MODES = ("trinary", "scale", "raw")


def write(folder: Path, pixels: np.ndarray, **settings: object) -> Path:
    """Write a map as its users do, and return the path of the YAML file."""
    settings = SETTINGS | settings
    cv2.imwrite(str(folder / settings["image"]), pixels)
    path = folder / "map.yaml"
    path.write_text(yaml.safe_dump(settings))
    return path


def occupancy(pixel: list[int], mode: str, negate: int, occupied: float, free: float) -> int:
    """Return the occupancy of one pixel (gray, BGR or BGRA), -1 for unknown."""
    colors = (pixel * 3)[:3] if len(pixel) == 1 else pixel[:3]
    alpha = pixel[3] if len(pixel) == 4 else 255
    if mode == "trinary" and len(pixel) == 4:
        colors = [*colors, alpha]
    shade = sum(colors) / len(colors) / 255
    if mode == "raw":
        value = int(shade * 255 + 0.5)
        return value if value <= 100 else -1
    occ = shade if negate else 1 - shade
    if mode == "scale" and alpha != 255:
        return -1
    if occ > occupied:
        return 100
    if occ < free:
        return 0
    if mode == "trinary":
        return -1
    # Nav2 computes in single precision and rounds halves up: of 0.65 and 0.25, 37.5 and 87.5.
    single = np.float32
    shade = single(sum(colors) / len(colors)) / single(255)
    occ = shade if negate else single(1) - shade
    scaled = (occ - single(free)) / single(occupied - free) * single(100)
    return math.floor(float(scaled) + 0.5)


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("negate", [0, 1])
@pytest.mark.parametrize("mode", MODES)
def test_every_pixel_has_the_occupancy_of_map_server(tmp_path, mode, negate, channels):
    random = np.random.default_rng(7)
    pixels = random.integers(0, 256, (17, 31, channels), np.uint8)
    if channels == 4:
        pixels[::2, :, 3] = 255
    path = write(tmp_path, pixels, mode=mode, negate=negate, image="map.png")
    grid_map = load_map_server(path)
    assert (grid_map.layers, grid_map.frame_id) == (("occupancy",), "map")
    assert (grid_map.size, grid_map.resolution) == ((31, 17), 0.5)
    for row, column in itertools.product(range(17), range(31)):
        # The origin is the lower left corner, and rows of an image run down.
        position = (-10.0 + 0.5 * (column + 0.5), 4.0 + 0.5 * (17 - row - 0.5))
        expected = occupancy(pixels[row, column].tolist(), mode, negate, 0.65, 0.25)
        found = grid_map.at_position("occupancy", position)
        assert (-1 if np.isnan(found) else found) == expected


@pytest.mark.parametrize("thresholds", [{}, {"occupied_thresh": 0.9, "free_thresh": 0.3}])
@pytest.mark.parametrize("negate", [False, True])
@pytest.mark.parametrize("mode", MODES)
def test_values_round_trip_within_limits_of_the_mode(tmp_path, mode, negate, thresholds):
    values = np.concatenate([np.arange(101), [np.nan, -1, 100, 0]]).reshape(15, 7)
    layers = {"cost": values, "share": 1.0 - 0.005 * values}
    grid_map = moved_in_buffer(GridMap((1.5, 0.7), 0.1, layers=layers), (4, 2))
    bounds = {"data_min": 1.0, "data_max": 0.5}
    found = []
    for options in ({"layer": "cost"}, {"layer": "share"} | bounds):
        path = tmp_path / options["layer"] / "map.yaml"
        path.parent.mkdir()
        save_map_server(grid_map, path, mode=mode, negate=negate, **thresholds, **options)
        found.append(load(path.parent)["occupancy"])
    # Only NaN is unknown in a scaled layer; values beyond the bounds are clamped.
    assert (found[0][values == -1], found[1][values == -1]) == (
        pytest.approx(np.nan, nan_ok=True),
        0,
    )
    np.testing.assert_array_equal(found[0][values != -1], found[1][values != -1])
    expected = np.where(values == -1, np.nan, values)
    if mode == "trinary":
        free, occupied = (30, 90) if thresholds else (20, 65)
        is_between = (expected > free) & (expected < occupied)
        expected = np.where(is_between, np.nan, np.where(expected <= free, 0, expected))
        expected = np.where(expected >= occupied, 100, expected)
    np.testing.assert_array_equal(found[0], expected)


def test_a_pgm_file_may_name_another_white(tmp_path):
    path = write(tmp_path, np.zeros((1, 1), np.uint8))
    (tmp_path / "map.pgm").write_bytes(b"P5 # by hand\n3 1\n# white\n100\n" + bytes([0, 50, 100]))
    occupied = load_map_server(path)["occupancy"][::-1, 0]
    np.testing.assert_array_equal(occupied, [100, np.nan, 0])
    (tmp_path / "map.pgm").write_text("P2\n3 1\n255\n0 128 255\n")
    np.testing.assert_array_equal(load_map_server(path)["occupancy"][::-1, 0], occupied)


def test_saving_again_replaces_the_image_last(tmp_path, monkeypatch):
    path, grid_map = tmp_path / "hall.yaml", GridMap((1, 1), 0.5, layers={"occupancy": 0.0})
    save(grid_map, path)
    (tmp_path / "hall_2.pgm").write_text("of another")
    grid_map["occupancy"] = 100.0
    replace = Path.replace

    def fail_for_yaml(source: Path, target: Path) -> Path:
        if target.suffix == ".yaml":
            raise OSError(28, "No space left on device")
        return replace(source, target)

    monkeypatch.setattr(Path, "replace", fail_for_yaml)
    with pytest.raises(GridMapError, match=r"hall\.yaml: cannot be written: No space left"):
        save(grid_map, path)
    monkeypatch.undo()
    assert (load(path)["occupancy"] == 0).all()
    save(grid_map, path)
    assert (load(path)["occupancy"] == 100).all()
    assert (tmp_path / "hall_2.pgm").read_text() == "of another"
    assert not (tmp_path / "hall.pgm").exists()


@pytest.mark.parametrize("image", ["hall_of_all_floors.pgm", "hall.yaml", "hall.npz"])
def test_saving_again_removes_no_other_file_that_is_named(tmp_path, image):
    (tmp_path / image).touch()
    path = tmp_path / "hall.yaml"
    path.write_text(yaml.safe_dump(SETTINGS | {"image": image}))
    save(GridMap((1, 1), 0.5, layers={"occupancy": 0.0}), path)
    assert (tmp_path / image).exists()
    assert (load(path)["occupancy"] == 0).all()


WRONG = {
    "image": (None, "'image': expected a string, got nothing"),
    "origin": ([0.0, 0.0, 0.3], "'origin': expected a yaw of 0 .* got 0.3"),
    "mode": ("trinity", "'mode': expected one of 'trinary', 'scale', 'raw', got 'trinity'"),
    "occupied_thresh": (float("nan"), "'occupied_thresh': expected a finite number, got nan"),
}


@pytest.mark.parametrize("key", WRONG)
def test_a_wrong_key_is_named(tmp_path, key):
    value, message = WRONG[key]
    path = write(tmp_path, np.zeros((2, 2), np.uint8))
    path.write_text(yaml.safe_dump(SETTINGS | {key: value}))
    with pytest.raises(GridMapError, match="map.yaml: parameter " + message):
        load_map_server(path)


def test_missing_or_damaged_files_are_one_error(tmp_path):
    path = write(tmp_path, np.zeros((2, 2), np.uint8))
    with pytest.raises(LayerNotFoundError, match="'cost'; available: occupancy"):
        load_map_server(path, layers=["cost"])
    (tmp_path / "map.pgm").unlink()
    with pytest.raises(GridMapError, match=r"map\.pgm: cannot be read: No such file"):
        load_map_server(path)
    path.write_text("- a list")
    with pytest.raises(GridMapError, match="expected keys and values"):
        load_map_server(path)


@pytest.mark.parametrize("values", [[0.0, 0.4, 1.0], [0, 254, 0], [0, 49.6, 100], [0, np.inf, 1]])
def test_values_that_are_no_occupancies_are_refused(tmp_path, values):
    grid_map = GridMap((0.5, 1.5), 0.5, layers={"traversability": [values]})
    message = r"layer 'traversability': expected occupancies .* got {:g}\. Pass .* data_max=0\.0"
    with pytest.raises(GridMapError, match=message.format(values[1])):
        save(grid_map, tmp_path / "hall.yaml", layer="traversability")
    for bounds in ({"data_min": 1.0}, {"data_min": 1.0, "data_max": 1.0}, {"data_max": np.inf}):
        with pytest.raises(GridMapError, match="data_min, data_max: expected two different finite"):
            save(grid_map, tmp_path / "hall.yaml", **bounds)
    assert [*tmp_path.iterdir()] == []


def test_invalid_options_write_nothing(tmp_path):
    grid_map = GridMap((1, 1), 0.5, layers={"a": 0.0, "b": 1.0})
    for options, message in (
        ({"mode": "grey"}, "mode: expected one of trinary"),
        ({"occupied_thresh": 0.1}, "free_thresh, occupied_thresh: expected 0 <= free < occupied"),
        ({}, "no layer 'occupancy'; available: a, b"),
    ):
        with pytest.raises(GridMapError, match=message):
            save_map_server(grid_map, tmp_path / "a.yaml", **options)
    (tmp_path / "a.yaml").write_text("topics: {}")
    with pytest.raises(GridMapError, match="the existing file is not a map of map_server"):
        save_map_server(grid_map, tmp_path / "a.yaml", layer="a")
    assert [file.name for file in tmp_path.iterdir()] == ["a.yaml"]
