# SPDX-License-Identifier: BSD-3-Clause
"""Points of depth images, and cells that cameras see."""

import math
from typing import Any

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image

from grid_map_core_py import GridMap
from grid_map_ros_py import MessageError
from grid_map_ros_py._elevation_mapping.cameras import (
    Camera,
    CameraImages,
    from_camera_info,
    seen_cells,
)
from grid_map_ros_py.messages import serialize, view
from grid_map_ros_py.messages._image import from_pixels

COEFFICIENTS = {
    "plumb_bob": (-0.25, 0.08, 0.001, -0.002, -0.01),
    "rational_polynomial": (0.5, -0.1, 0.001, -0.002, 0.01, 0.7, -0.05, 0.02),
    "equidistant": (0.05, -0.01, 0.004, -0.001),
}
ROWS, COLUMNS = 48, 64


def camera_info(model: str = "", **fields: Any) -> CameraInfo:
    message = CameraInfo(height=ROWS, width=COLUMNS, distortion_model=model or "plumb_bob")
    message.k = np.array([50.0, 0, 31, 0, 52.0, 24, 0, 0, 1])
    message.d = COEFFICIENTS.get(model, [])
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def image(pixels: np.ndarray, encoding: str) -> Image:
    return from_pixels(pixels, encoding, CameraInfo().header)


# --- lenses ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", COEFFICIENTS)
def test_points_are_projected_as_by_opencv(model: str) -> None:
    camera = from_camera_info(camera_info(model))
    generator = np.random.default_rng(1)
    depth = generator.uniform(0.5, 5.0, (300, 1))
    points = np.hstack([generator.uniform(-0.4, 0.4, (300, 2)) * depth, depth])
    matrix, zeros = np.asarray(camera_info().k).reshape(3, 3), np.zeros(3)
    project = cv2.fisheye.projectPoints if model == "equidistant" else cv2.projectPoints
    coefficients = np.array(COEFFICIENTS[model])
    expected = project(points[:, None], zeros, zeros, matrix, coefficients)[0].reshape(-1, 2)
    found = camera.project(points)
    seen = np.isfinite(found[:, 0])
    assert seen.sum() > 200
    np.testing.assert_allclose(found[seen], expected[seen], atol=1e-6)
    for pixel in expected[~seen]:
        assert not ((pixel > 0) & (pixel < (COLUMNS - 1, ROWS - 1))).all()


@pytest.mark.parametrize("model", ["", *COEFFICIENTS])
def test_rays_lead_back_to_their_pixels(model: str) -> None:
    camera = from_camera_info(camera_info(model))
    rays = camera.rays(3).astype(np.float64)
    assert rays.shape == (ROWS / 3, math.ceil(COLUMNS / 3), 2)
    points = np.concatenate([3.0 * rays, np.full((*rays.shape[:2], 1), 3.0)], axis=2)
    found = camera.project(points.reshape(-1, 3)).reshape(*rays.shape)
    known = np.isfinite(found[..., 0])
    assert known.mean() > 0.95
    expected = np.stack(np.meshgrid(range(0, COLUMNS, 3), range(0, ROWS, 3)), axis=2)
    np.testing.assert_allclose(found[known], expected[known], atol=0.2)


def test_points_behind_or_beside_the_camera_are_not_seen() -> None:
    camera = Camera((ROWS, COLUMNS), (50.0, 50.0), (31.5, 23.5), "plumb_bob", (-0.3, 0.0))
    points = [(0, 0, -1), (0, 0, 0), (9, 0, 1), (math.nan, 0, 1), (1e300, 0, 1e-300), (0, 0, 2)]
    found = camera.project(np.array(points, np.float64))
    assert np.isnan(found[:-1]).all()
    np.testing.assert_array_equal(found[-1], (31.5, 23.5))


def test_binning_and_region_move_the_pixels() -> None:
    whole = from_camera_info(camera_info())
    message = camera_info(binning_x=2, binning_y=2)
    message.roi.x_offset, message.roi.y_offset = 8, 4
    message.roi.width, message.roi.height = 40, 32
    part = from_camera_info(message)
    assert part.size == (16, 20)
    point = np.array([[0.1, -0.05, 1.0]])
    u, v = whole.project(point)[0]
    np.testing.assert_allclose(part.project(point)[0], ((u - 7.5) / 2 - 0.5, (v - 3.5) / 2 - 0.5))


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"k": np.zeros(9)}, "k: expected finite numbers with positive focal lengths; calibrate"),
        ({"k": np.full(9, math.nan)}, "k: expected finite"),
        ({"d": [0.1, math.inf]}, "d: expected finite numbers"),
        ({"d": [0.1], "distortion_model": "magic"}, "distortion_model: expected one of plumb_bob,"),
        ({"height": 0}, "height: expected at least one pixel"),
        ({"width": 1, "binning_x": 2}, "width: expected at least one pixel"),
    ],
)
def test_impossible_camera_is_refused(fields: dict[str, Any], reason: str) -> None:
    with pytest.raises(MessageError) as caught:
        from_camera_info(camera_info(**fields))
    assert str(caught.value).startswith(reason)


# --- depth images ---------------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["16UC1", "mono16", "32FC1", "64FC1"])
@pytest.mark.parametrize("stride", [1, 3])
def test_depths_become_points(encoding: str, stride: int) -> None:
    depths = np.random.default_rng(2).integers(1, 5000, (ROWS, COLUMNS)).astype(np.float64)
    depths[5, 6], depths[6, 6] = 0, 0
    dtype = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4", "64FC1": "f8"}[encoding]
    scale = 1.0 if dtype == "u2" else 0.001
    pixels = (depths * scale).astype(dtype)
    if dtype != "u2":
        pixels[6, 6], pixels[9, 9], pixels[12, 12] = math.nan, math.inf, -1.0
    message = image(pixels, encoding)
    images = CameraImages(stride, from_camera_info(camera_info()))
    scan = images.read_depths(view(serialize(message), Image))
    expected = []
    for row in range(0, ROWS, stride):
        for column in range(0, COLUMNS, stride):
            z = float(pixels[row, column]) * (0.001 if dtype == "u2" else 1.0)
            if math.isfinite(z) and z > 0:
                expected.append(((column - 31) / 50 * z, (row - 24) / 52 * z, z))
    np.testing.assert_allclose(scan.points, expected, rtol=1e-5, atol=1e-6)
    assert scan.points.dtype == np.float32
    assert len(scan) + scan.missing == math.ceil(ROWS / stride) * math.ceil(COLUMNS / stride)


def test_new_camera_replaces_the_rays() -> None:
    images = CameraImages(1, from_camera_info(camera_info()))
    message = image(np.full((ROWS, COLUMNS), 2.0, np.float32), "32FC1")
    before = images.read_depths(message).points
    images.camera = from_camera_info(camera_info(k=np.diag([100.0, 104.0, 1]).ravel()))
    assert images.read_depths(message).points[0, 0] == 0.0
    assert before[0, 0] < 0


def test_image_that_does_not_fit_its_camera_is_refused() -> None:
    images = CameraImages()
    message = image(np.ones((ROWS, COLUMNS), np.float32), "32FC1")
    with pytest.raises(MessageError, match="camera_info: expected a message before the first"):
        images.read_depths(message)
    images.camera = from_camera_info(camera_info(width=COLUMNS + 1))
    with pytest.raises(
        MessageError, match=r"height, width: expected those of the camera, \(48, 65"
    ):
        images.read_depths(message)
    images.camera = from_camera_info(camera_info())
    for wrong, *channels, dtype in (("mono8", np.uint8), ("32FC3", 3, np.float32)):
        with pytest.raises(MessageError, match="encoding: expected 16UC1, mono16, 32FC1 or 64FC1"):
            images.read_depths(image(np.ones((ROWS, COLUMNS, *channels), dtype), wrong))


# --- what a camera sees ---------------------------------------------------------------------------


def looking_down(height: float, x: float = 0.0) -> np.ndarray:
    """Return the pose of a camera above the ground; up in its image is +x."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0, -1, 0], [-1, 0, 0], [0, 0, -1]])
    pose[:3, 3] = x, 0, height
    return pose


WIDE = Camera((100, 100), (20.0, 20.0), (49.5, 49.5))


def seen(grid_map: GridMap, pose: np.ndarray) -> set[tuple[float, float]]:
    cells, pixels = seen_cells(grid_map, "elevation", WIDE, pose)
    x, y = grid_map.axes()
    points = np.stack([x[cells[0]], y[cells[1]], grid_map["elevation"][cells]], axis=1)
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    np.testing.assert_array_less(np.abs(WIDE.project(local) - np.stack(pixels[::-1], 1)), 0.51)
    return {(round(px, 3), round(py, 3)) for px, py, _ in points.tolist()}


@pytest.mark.parametrize("moves", [False, True])
def test_wall_hides_the_ground_behind_it(moves: bool) -> None:
    grid_map = GridMap((4.0, 2.0), 0.1, layers={"elevation": math.nan})
    if moves:
        grid_map.move((0.7, -0.3))
        grid_map.move((0.0, 0.0))
    heights = np.zeros(grid_map.size, np.float32)
    x, _ = grid_map.geometry.axes_in_map_order()
    heights[np.isclose(x, 0.55)] = 0.5
    heights[3, 4] = math.nan
    grid_map.set_unwrapped("elevation", heights)
    found = {px for px, py in seen(grid_map, looking_down(1.0)) if py == 0.05}
    # The shadow of the wall, from its near edge at 0.5 m to twice that distance.
    expected = {px for px in np.round(x, 3).tolist() if not 0.6 < px < 1.0}
    assert expected - {1.15} <= found | {0.95, 1.05} <= expected | {0.95, 1.05, 1.15}


def test_cells_without_height_and_outside_the_image_are_not_seen() -> None:
    grid_map = GridMap((4.0, 2.0), 0.1, layers={"elevation": 0.0})
    grid_map["elevation"][:, 3] = math.nan
    found = seen(grid_map, looking_down(0.5))
    # The image shows 1.25 m to each side.
    assert {px for px, _ in found} == {round(0.1 * k - 1.15, 3) for k in range(24)}
    assert len({py for _, py in found}) == 19
    empty = GridMap((1.0, 1.0), 0.1, layers={"elevation": math.nan})
    assert seen(empty, looking_down(0.5)) == set()
