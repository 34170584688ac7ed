# SPDX-License-Identifier: BSD-3-Clause
"""The image demos as users start them: real processes over DDS."""

import cv2
import numpy as np
import pytest
from demos import DATA, parameters, published
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from grid_map_core_py import GridMap, color_value_to_vector
from grid_map_core_py.conversions import to_image
from grid_map_demos_py.opencv_demo_node import blur, kernel_size
from grid_map_demos_py.parts import star_map
from grid_map_demos_py.resolution_change_demo_node import resolution_at
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, from_stamp, to_message, to_stamp
from grid_map_ros_py.messages._image import from_pixels, to_pixels
from grid_map_ros_py.testing import peer, running_node, start_node


def module(demo: str) -> str:
    return f"grid_map_demos_py.{demo}_node"


# --- image_publisher ------------------------------------------------------------------------------


def test_terrain_image_becomes_a_map_of_heights_and_colors():
    terrain = cv2.imread(str(DATA / "terrain.png"), cv2.IMREAD_UNCHANGED)
    with peer() as other:
        other.listen("/image", Image)
        other.listen("/grid_map", GridMapMessage)
        with (
            running_node(module("image_publisher"), *parameters("publish_rate:=2.0")),
            running_node(module("image_to_gridmap_demo")),
        ):
            message = other.expect("/image", 2)
            grid_map = from_message(other.expect("/grid_map"))
        stamps = [from_stamp(image.header.stamp) for image in other.received["/image"]]
    assert (message.encoding, message.header.frame_id) == ("bgra8", "map")
    np.testing.assert_array_equal(to_pixels(message)[0], terrain)
    assert np.diff(stamps).min() > 0.0
    assert grid_map.size == (101, 86)
    assert (grid_map.resolution, grid_map.frame_id) == (0.03, "map")
    assert grid_map.layers == ("elevation", "color")
    assert grid_map.basic_layers == ("elevation",)
    assert grid_map.timestamp in stamps
    is_opaque = terrain[..., 3] == 255
    assert 0 < is_opaque.sum() < is_opaque.size
    rgb = color_value_to_vector(grid_map["color"])
    np.testing.assert_allclose(rgb[is_opaque], terrain[is_opaque][:, 2::-1] / 255, atol=1e-6)
    luma = terrain[..., :3] @ [0.114, 0.587, 0.299] / 255
    np.testing.assert_allclose(grid_map["elevation"][is_opaque], luma[is_opaque], atol=0.003)
    assert np.isnan(grid_map["elevation"][~is_opaque]).all()
    assert np.isnan(grid_map["color"][~is_opaque]).all()


def test_image_file_is_read_again_for_every_message(tmp_path):
    file = tmp_path / "image.ppm"
    file.write_bytes(b"P5 2 1 65535\n\0\1\xff\xff")
    given = parameters(f"image_path:={file}", "topic:=/scan", "frame_id:=odom", "publish_rate:=20")
    with peer() as other:
        other.listen("/scan", Image)
        with running_node(module("image_publisher"), *given) as publisher:
            first = other.expect("/scan")
            file.write_bytes(b"")
            other.wait_until(lambda: "cannot be read: not an image" in publisher.text, "log")
            file.write_bytes(b"P6 1 1 255\n\xff\0\1")
            other.wait_until(lambda: other.received["/scan"][-1].encoding == "bgr8", "a new image")
            last = other.received["/scan"][-1]
    assert (first.encoding, first.header.frame_id) == ("mono16", "odom")
    assert to_pixels(first)[0].ravel().tolist() == [1, 65535]
    assert (last.height, last.width, last.step) == (1, 1, 3)
    assert list(last.data) == [1, 0, 255]


# --- image_to_gridmap_demo ------------------------------------------------------------------------


def image_message(encoding: str, pixels: np.ndarray, nanoseconds: int = 0) -> Image:
    header = Header(frame_id="camera", stamp=to_stamp(nanoseconds))
    return from_pixels(np.atleast_3d(pixels), encoding, header)


def test_first_image_sets_the_size_of_later_ones():
    gray = np.array([[0, 65535, 13107], [52428, 26214, 39321]], "<u2")
    green_and_glass = np.array([[[0, 255, 0, 255]] * 3, [[10, 20, 30, 100]] * 3], np.uint8)
    given = parameters("min_height:=1", "max_height:=-1.0", "resolution:=0.5", "map_frame_id:=odom")
    with peer() as other:
        other.listen("/grid_map", GridMapMessage)
        with running_node(module("image_to_gridmap_demo"), *given) as demo:
            other.publish("/image", image_message("mono16", gray, 7_000_000_000))
            first = from_message(other.expect("/grid_map", 1))
            other.publish("/image", image_message("mono16", gray[:1]))
            other.wait_until(lambda: "(1, 3)" in demo.text, "a warning")
            other.publish("/image", image_message("rgba8", green_and_glass, 9))
            second = from_message(other.expect("/grid_map", 2))
    assert "dropped a message of /image: height, width: expected (2, 3)" in demo.text
    assert (first.frame_id, first.resolution, first.timestamp) == ("odom", 0.5, 7_000_000_000)
    assert second.timestamp == 9
    np.testing.assert_allclose(first["elevation"], [[1.0, -1.0, 0.6], [-0.6, 0.2, -0.2]], atol=1e-4)
    np.testing.assert_allclose(
        color_value_to_vector(first["color"])[0, 1:], [[1.0] * 3, [51 / 255] * 3], atol=1e-6
    )
    np.testing.assert_allclose(second["elevation"][0], 1.0 - 2.0 * 0.587, atol=0.005)
    np.testing.assert_array_equal(color_value_to_vector(second["color"])[0], [[0.0, 1.0, 0.0]] * 3)
    assert np.isnan(second["elevation"][1]).all()
    assert np.isnan(second["color"][1]).all()


@pytest.mark.parametrize("qos", [10, qos_profile_sensor_data], ids=["volatile", "camera"])
def test_volatile_images_become_maps_in_the_image_frame(qos):
    given = parameters("image_topic:=/camera/image", "map_frame_id:=''")
    with peer() as other:
        other.listen("/grid_map", GridMapMessage)
        publisher = other.node.create_publisher(Image, "/camera/image", qos)
        message = image_message("mono8", np.array([[255]], np.uint8))
        with running_node(module("image_to_gridmap_demo"), *given):

            def publish_until_a_map_comes() -> bool:
                publisher.publish(message)
                return bool(other.received["/grid_map"])

            other.wait_until(publish_until_a_map_comes, "a map")
            message.header.frame_id = "other"
            publisher.publish(message)
            maps = other.received["/grid_map"]
            other.wait_until(lambda: maps[-1].header.frame_id == "other", "a map in that frame")
    grid_map = from_message(maps[0])
    assert grid_map.frame_id == "camera"
    assert grid_map["elevation"].tolist() == [[1.0]]


# --- grid_map_to_image_demo -----------------------------------------------------------------------


SAVED = {
    "whole_range.png": [],
    "height.tiff": ["layer:=height", "bits:=16", "use_transparency:=true", "lower:=-1", "upper:=1"],
    "color.png": ["layer:=color", "use_transparency:=true"],
}
"""Parameters by file name."""


@pytest.fixture
def moved_map() -> GridMap:
    """A map with a nonzero start index and values in all cells except one."""
    grid_map = GridMap((0.4, 0.3), 0.1, layers=["elevation", "height"], frame_id="map")
    grid_map.move((0.2, -0.1))
    assert grid_map.start_index != (0, 0)
    x, y = grid_map.get_positions().T
    for layer, values in {"elevation": x + y / 4, "height": y}.items():
        grid_map[layer] = values.reshape(grid_map.size, order="F")
        grid_map[layer][grid_map.get_index((0.05, -0.2))] = np.nan
    grid_map["color"] = np.nan
    grid_map["color"][grid_map.get_index((0.35, 0.0))] = np.uint32(0xFF8001).view(np.float32)
    return grid_map


def seen_from_above(grid_map: GridMap, layer: str) -> np.ndarray:
    """Return the values at the pixel positions; the first row has the largest x."""
    xs, ys = (0.35, 0.25, 0.15, 0.05), (0.0, -0.1, -0.2)
    return np.array([[grid_map[layer][grid_map.get_index((x, y))] for y in ys] for x in xs])


def test_layers_are_saved_with_their_range_bits_and_transparency(moved_map, tmp_path):
    (tmp_path / "color.png").write_text("old")
    name = module("grid_map_to_image_demo")
    with peer() as other:
        demos = [
            start_node(name, *parameters(f"file:={tmp_path / file}", *pairs))
            for file, pairs in SAVED.items()
        ]
        other.publish("/grid_map", to_message(moved_map))
        for demo in demos:
            assert demo.wait() == 0, demo.text
            assert "Traceback" not in demo.text
    assert {path.name for path in tmp_path.iterdir()} == {*SAVED}
    whole_range, height, color = (
        cv2.imread(str(tmp_path / file), cv2.IMREAD_UNCHANGED) for file in SAVED
    )
    values = seen_from_above(moved_map, "elevation")
    low, high = np.nanmin(values), np.nanmax(values)
    expected = np.nan_to_num((values - low) / (high - low) * 255)
    assert (whole_range.dtype, whole_range.shape) == (np.uint8, (4, 3))
    np.testing.assert_allclose(whole_range, expected, atol=1.0)
    values = seen_from_above(moved_map, "height")
    assert (height.dtype, height.shape) == (np.uint16, (4, 3, 4))
    expected = np.nan_to_num((values + 1) / 2 * 65535)
    for channel in range(3):
        np.testing.assert_allclose(height[..., channel], expected, atol=1.0)
    np.testing.assert_array_equal(height[..., 3], np.where(np.isnan(values), 0, 65535))
    assert color[0, 0].tolist() == [0x01, 0x80, 0xFF, 255]
    assert np.count_nonzero(color[..., 3]) == 1


def test_demo_waits_for_a_valid_map_and_requires_the_layer(tmp_path):
    file = tmp_path / "map.png"
    broken = to_message(GridMap((1.0, 1.0), 0.5, layers={"elevation": 1.0}))
    broken.info.resolution = 0.0
    with peer() as other:
        demo = start_node(module("grid_map_to_image_demo"), *parameters(f"file:={file}"))
        try:
            other.publish("/grid_map", broken)
            other.wait_until(lambda: "dropped a message" in demo.text, "a warning")
            other.publish("/grid_map", to_message(GridMap((1.0, 1.0), 0.5, layers=["slope"])))
            assert demo.wait() == 1
        finally:
            demo.stop()
    assert "no layer 'elevation'; available: slope" in demo.lines[-1]
    assert "Traceback" not in demo.text
    assert not list(tmp_path.iterdir())


# --- opencv_demo, resolution_change_demo ----------------------------------------------------------


def test_kernel_size_follows_the_time_of_the_map():
    maps, _ = published("opencv_demo", count=25)
    expected = star_map("original", 0.01)
    image = to_image(expected, "original", np.uint16, 1, 0.0, 0.3)
    for grid_map in maps:
        blur(expected, image, kernel_size(1e-9 * grid_map.timestamp))
        assert grid_map.layers == ("original", "elevation")
        assert (grid_map.size, grid_map.frame_id) == ((120, 200), "map")
        for layer in grid_map:
            np.testing.assert_array_equal(grid_map[layer], expected[layer])
    assert len({kernel_size(1e-9 * grid_map.timestamp) for grid_map in maps}) > 5


def test_resolution_follows_the_time_of_the_map():
    maps, _ = published("resolution_change_demo", count=5)
    for grid_map in maps:
        side = resolution_at(1e-9 * grid_map.timestamp)
        assert grid_map.resolution == pytest.approx(side)
        assert grid_map.size == (round(40 * 0.03 / side), round(67 * 0.03 / side))
        np.testing.assert_allclose(grid_map.position, 0.0)
        assert grid_map.at_position("elevation", (0.0, 0.0)) == pytest.approx(0.3, abs=0.02)
        assert grid_map.at_position("elevation", (-0.5, 0.9)) == pytest.approx(0.0, abs=0.02)
    assert len({grid_map.resolution for grid_map in maps}) > 2


def test_nearest_resampling_mixes_no_values():
    given = ("use_transparency:=true", "interpolation:=nearest", "publish_rate:=50")
    (grid_map, *_), _ = published("resolution_change_demo", *given)
    is_star = np.isfinite(grid_map["elevation"])
    assert 0.05 < is_star.mean() < 0.4
    assert np.unique(grid_map["elevation"][is_star]).tolist() == [np.float32(0.3)]
