# SPDX-License-Identifier: BSD-3-Clause
"""Maps as images: folders with YAML, and height maps."""

import struct
import tempfile
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings, strategies as st

from grid_map_core_py import GeometryError, GridMap, LayerNotFoundError, color_vector_to_value
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import (
    load,
    load_height_image,
    load_images,
    load_map_server,
    map_facts,
    save,
    save_height_image,
    save_images,
)
from grid_map_core_py.files._image_folder import describe_images
from grid_map_core_py.testing import grid_maps, moved_in_buffer


def assert_equal_within_a_step(loaded: GridMap, saved: GridMap, entry: dict, bits: int) -> None:
    name, lower, upper = entry["name"], entry["lower"], entry["upper"]
    expected = np.clip(saved.unwrapped(name).astype(np.float64), *sorted((lower, upper)))
    step = abs(upper - lower) / (2**bits - 1)
    rounding = 4e-7 * max(abs(lower), abs(upper))
    np.testing.assert_allclose(loaded[name], expected, rtol=0, atol=step + rounding)


@settings(max_examples=40)
@given(grid_maps(("elevation", "größe/m")), st.sampled_from([8, 16]))
def test_map_round_trips_except_for_quantization(grid_map, bits):
    with tempfile.TemporaryDirectory() as folder:
        path = save_images(grid_map, Path(folder) / "images", bits=bits)
        loaded = load_images(path)
        assert describe_images(path)["map"] == map_facts(loaded)
        entries = yaml.safe_load(path.read_text())["grid_map"]["layers"]
    for name in ("size", "frame_id", "timestamp", "layers", "basic_layers", "resolution"):
        assert getattr(loaded, name) == getattr(grid_map, name), name
    assert loaded.position.tolist() == grid_map.position.tolist()
    for entry in entries:
        assert_equal_within_a_step(loaded, grid_map, entry, bits)


@pytest.mark.parametrize("value", [0.0, -3.5, 1e-40, 3e38, -3e38, np.nan, 7e6])
def test_constant_layer_round_trips_exactly(tmp_path, value):
    grid_map = GridMap((0.5, 0.3), 0.1, layers={"a": value})
    save_images(grid_map, tmp_path / "images")
    np.testing.assert_array_equal(load_images(tmp_path / "images")["a"], grid_map["a"])


def test_every_pixel_value_is_kept(tmp_path):
    values = np.arange(65536, dtype=np.float32).reshape(256, 256)
    grid_map = GridMap((256, 256), 1.0, layers={"full": values, "holes": values})
    grid_map["holes"][3, 5] = np.nan
    loaded = load_images(save_images(grid_map, tmp_path / "images"))
    for layer in grid_map:
        np.testing.assert_array_equal(loaded[layer], grid_map[layer])


def test_colors_round_trip_exactly(tmp_path):
    colors = np.random.default_rng(1).integers(0, 256, (5, 3, 3))
    grid_map = GridMap((0.5, 0.3), 0.1, layers={"color": color_vector_to_value(colors)})
    grid_map["color"][4, 1] = np.nan
    loaded = load_images(save_images(grid_map, tmp_path / "images"))
    assert loaded["color"].tobytes() == grid_map["color"].tobytes()


def test_given_ranges_clamp(tmp_path):
    grid_map = GridMap((0.4, 0.1), 0.1, layers={"a": [[-5.0], [0.0], [1.0], [9.0]]})
    loaded = load_images(save_images(grid_map, tmp_path / "images", ranges={"a": (0.0, 1.0)}))
    assert loaded["a"].ravel().tolist() == [0.0, 0.0, 1.0, 1.0]


def test_only_the_wanted_layers_are_written(tmp_path):
    grid_map = GridMap((1, 1), 0.5, layers=["a", "b", "c"], basic_layers=["a", "b"])
    loaded = load_images(save_images(grid_map, tmp_path / "images", ["c", "b"]))
    assert (loaded.layers, loaded.basic_layers) == (("c", "b"), ("b",))


# --- as read by map_server ------------------------------------------------------------------------


@pytest.mark.parametrize("start_index", [(0, 0), (2, 1)])
def test_map_server_shows_the_first_layer_as_occupancies(tmp_path, start_index):
    values = np.array([[2.0, 3.0], [4.0, np.nan], [2.0, 2.0]])
    grid_map = GridMap((0.3, 0.2), 0.1, (1.0, 2.0), {"a": values})
    path = save_images(moved_in_buffer(grid_map, start_index), tmp_path / "images")
    seen = load_map_server(path)
    np.testing.assert_allclose(seen.position, grid_map.position)
    assert (seen.size, seen.resolution) == (grid_map.size, grid_map.resolution)
    np.testing.assert_array_equal(seen["occupancy"], 50 * (values - 2))
    assert yaml.safe_load(path.read_text())["mode"] == "scale"


def test_unusual_layer_names_get_distinct_files(tmp_path):
    names = ["a/b", "a b", "A_B", "..", "ü", "x" * 300, "map"]
    grid_map = GridMap((1, 1), 0.5, layers={n: float(i) for i, n in enumerate(names)})
    path = save_images(grid_map, tmp_path / "images")
    assert len({file.name.lower() for file in path.parent.iterdir()}) == len(names) + 1
    loaded = load_images(path)
    assert [loaded[name][0, 0] for name in names] == [*range(len(names))]


# --- writing --------------------------------------------------------------------------------------


def test_folder_without_map_images_is_never_replaced(tmp_path):
    (tmp_path / "notes.txt").write_text("precious")
    grid_map = GridMap((1, 1), 0.5, layers=["a"])
    with pytest.raises(GridMapError, match=r"cannot be written: it holds notes\.txt"):
        save_images(grid_map, tmp_path)
    with pytest.raises(GridMapError, match="it is a file"):
        save_images(grid_map, tmp_path / "notes.txt")
    assert [file.name for file in tmp_path.iterdir()] == ["notes.txt"]


def test_foreign_files_are_never_replaced(tmp_path):
    grid_map = GridMap((1, 1), 0.5, layers=["a"])
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    save_images(grid_map, ours)
    (ours / "photo.png").write_bytes(b"precious")
    theirs.mkdir()
    (theirs / "map.yaml").write_text("{image: office.png, resolution: 0.05, origin: [0, 0, 0]}")
    with pytest.raises(GridMapError, match=r"it holds photo\.png, which is no part of a saved map"):
        save_images(grid_map, ours)
    with pytest.raises(GridMapError, match=r"it holds map\.yaml, which is no part of a saved map"):
        save_images(grid_map, theirs)


@pytest.mark.parametrize("name", ["\u2028", "null", "1", "../x", "höhe"])
def test_any_name_round_trips(tmp_path, name):
    save_images(GridMap((1, 1), 0.5, layers=[name], frame_id=name), tmp_path / "images")
    loaded = load_images(tmp_path / "images")
    assert (loaded.layers, loaded.frame_id) == ((name,), name)


def test_yaml_file_names_its_folder(tmp_path):
    path = tmp_path / "images" / "map.yaml"
    assert save_images(GridMap((1, 1), 0.5, layers=["a"]), path) == path
    assert load_images(path).layers == load_images(path.parent).layers == ("a",)


def test_maps_that_cannot_become_images_are_refused(tmp_path):
    grid_map = GridMap((1, 1), 0.5, layers={"a": [[-3e38, 3e38], [0, 0]]})
    with pytest.raises(GeometryError, match="two different finite"):
        save_images(grid_map, tmp_path / "images")
    with pytest.raises(LayerNotFoundError):
        save_images(grid_map, tmp_path / "images", ["b"])
    with pytest.raises(LayerNotFoundError):
        save_images(grid_map, tmp_path / "images", ranges={"b": (0.0, 1.0)})
    with pytest.raises(GridMapError, match="bits: expected 8 or 16, got 32"):
        save_images(grid_map, tmp_path / "images", bits=32)
    with pytest.raises(GridMapError, match="there are no layers"):
        save_images(GridMap((1, 1), 0.5), tmp_path / "images")
    assert list(tmp_path.iterdir()) == []


# --- damaged files --------------------------------------------------------------------------------


@pytest.fixture
def saved(tmp_path) -> Path:
    grid_map = GridMap((0.5, 0.3), 0.1, layers={"a": np.arange(15.0).reshape(5, 3)})
    return save_images(grid_map, tmp_path / "images")


def changed(path: Path, **changes: object) -> Path:
    document = yaml.safe_load(path.read_text())
    for name, value in changes.items():
        owner = document if name in document else document["grid_map"]
        owner = owner if name in owner else owner["layers"][0]
        owner[name] = value
    path.write_text(yaml.safe_dump(document))
    return path


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"grid_map": 3}, "'grid_map' is missing"),
        ({"version": 9}, "version 9, only 1 is known"),
        (
            {"size": [500, 500]},
            "a.png: cannot be read: expected 500 x 500 pixels, got 5 x 3",
        ),
        ({"size": 3}, ""),
        ({"resolution": 0}, "resolution"),
        ({"position": "here"}, ""),
        ({"layers": 3}, ""),
        ({"layers": [3]}, ""),
        ({"layers": [{"name": "a"}]}, "'image' is missing"),
        (
            {"image": "b.png", "layers": [{"name": "a", "image": "b.png"}]},
            "b.png: cannot be read: No such file",
        ),
        ({"mode": "scale", "lower": "low"}, "lower"),
        ({"basic_layers": ["b"]}, "'b' is not among the layers"),
        ({"timestamp": 1.5}, "timestamp"),
        ({"frame_id": "a\0"}, "frame_id: expected a string without control characters"),
        ({"layers": [{"name": "\x1b[2J", "image": "a.png"}]}, "expected the name of a layer"),
    ],
    ids=range(15),
)
def test_invalid_yaml_is_refused(saved, changes, reason):
    with pytest.raises(GridMapError, match=rf"{saved.parent}/\S+: cannot be read: ") as caught:
        load_images(changed(saved, **changes))
    assert reason in str(caught.value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [("", "'grid_map' is missing"), ("[" * 9999, "nested"), ("{", "no valid YAML")],
    ids=range(3),
)
def test_yaml_of_no_map_is_refused(saved, text, reason):
    saved.write_text(text)
    with pytest.raises(GridMapError, match=rf"map\.yaml: .*{reason}"):
        load_images(saved)


def test_a_path_out_of_the_folder_is_not_followed(saved, tmp_path):
    (saved.parent / "a.png").rename(tmp_path / "other.png")
    layers = [{"name": "a", "image": "../other.png", "mode": "values", "lower": 0, "upper": 1}]
    with pytest.raises(GridMapError, match=r"images/other\.png: cannot be read: No such file"):
        load_images(changed(saved, layers=layers))


def test_truncated_or_damaged_image_is_refused(saved):
    image = saved.parent / "a.png"
    data = image.read_bytes()
    for cut in range(len(data)):
        image.write_bytes(data[:cut])
        with pytest.raises(GridMapError, match=r"a\.png: cannot be read: "):
            load_images(saved)
    for place in range(len(data)):
        image.write_bytes(data[:place] + bytes([data[place] ^ 0x55]) + data[place + 1 :])
        with pytest.raises(GridMapError, match=r"a\.png: cannot be read: "):
            load_images(saved)


def test_image_claiming_gigabytes_is_refused_before_decoding(saved):
    head = b"IHDR" + struct.pack(">IIBBBBB", 30_000, 30_000, 16, 6, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head
    (saved.parent / "a.png").write_bytes(data + struct.pack(">I", zlib.crc32(head)))
    with pytest.raises(GridMapError, match="expected 5 x 3 pixels, got 30000 x 30000"):
        load_images(saved)


# --- height maps ----------------------------------------------------------------------------------


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


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("ending", [".png", ".tif"])
def test_up_is_y_and_white_is_the_upper_bound(tmp_path, ending, dtype):
    if ending == ".png" and dtype not in (np.uint8, np.uint16):
        return
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


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.bmp", "a.pgm"])
def test_a_damaged_image_is_one_error(tmp_path, name):
    path = tmp_path / name
    cv2.imwrite(str(path), np.random.default_rng(1).integers(0, 255, (40, 30), np.uint8))
    data = path.read_bytes()
    # OpenCV would read the last one, of another kind.
    other = cv2.imencode(".webp", np.zeros((40, 30, 3), np.uint8))[1].tobytes()
    for damaged in (b"", b"no image", data[: len(data) // 2], other):
        path.write_bytes(damaged)
        with pytest.raises(GridMapError, match=f"{name}: cannot be read: "):
            load_height_image(path, resolution=1.0)
