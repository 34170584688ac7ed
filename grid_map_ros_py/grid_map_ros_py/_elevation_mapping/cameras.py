# SPDX-License-Identifier: BSD-3-Clause
"""Camera model: converts depth images to points, and finds the map cells visible in an image.

Camera frames are optical frames (REP-103): x right, y down, z forward. Pixel coordinates (u, v) are
column and row. Pixel centers have integer coordinates.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import cv2
import numpy as np
import numpy.typing as npt
from sensor_msgs.msg import Image

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Cells, slices
from grid_map_core_py.limits import check_cells

from ..errors import MessageError
from ..messages._cdr import view
from ..messages._fields import Matrix, check_fields, from_stamp
from ..messages._image import to_pixels
from ..nodes._scans import Cloud

Floats = npt.NDArray[np.float64]

DISTORTIONS = {"plumb_bob": 8, "rational_polynomial": 8, "equidistant": 4, "fisheye": 4}
"""Number of coefficients of each distortion model, by its name in `CameraInfo`."""

MILLIMETERS = {"16UC1", "mono16"}
"""Image encodings of depths in millimeters (REP-118); depths in other encodings are in meters."""

ROUNDS = 30
"""Number of fixed-point iterations when undistorting a pixel."""

_PIECE = 2**13
"""Number of pixels whose rays are computed at once."""

LARGEST_RESIDUE = 0.1
"""Largest accepted reprojection error of a ray [pixels]; rays with larger errors become NaN."""

OCCLUSION_TOLERANCE = 0.5
"""Height by which a cell must rise above a line of sight to block it [cell sizes]."""


@dataclass(frozen=True)
class Camera:
    """Pinhole camera with lens distortion.

    Attributes:
        size: height and width of the images [pixels].
        focal: (fx, fy) focal lengths [pixels].
        center: (cx, cy) principal point [pixels].
        model: name of the distortion model, one of `DISTORTIONS`.
        coefficients: distortion coefficients; missing ones are 0.
    """

    size: tuple[int, int]
    focal: tuple[float, float]
    center: tuple[float, float]
    model: str = "plumb_bob"
    coefficients: tuple[float, ...] = ()

    def project(self, points: Floats) -> Floats:
        """Project points (N, 3) [m] in the camera frame to pixels (N, 2), NaN if out of view."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            flat = points[:, :2] / points[:, 2:]
            pixels = self._distorted(flat) * self.focal + self.center
            height, width = self.size
            is_seen = (points[:, 2] > 0) & (np.linalg.norm(flat, axis=1) <= self._reach)
            is_seen &= (pixels > -0.5).all(axis=1) & (pixels < (width - 0.5, height - 0.5)).all(1)
        return np.where(is_seen[:, None], pixels, np.nan)

    def rays(self, stride: int = 1) -> npt.NDArray[np.float32]:
        """Return x, y at depth 1 (rows, cols, 2) for the rays through every `stride`-th pixel.

        Rays are NaN where the distortion cannot be inverted.
        """
        height, width = self.size
        u, v = np.arange(0.0, width, stride), np.arange(0.0, height, stride)
        rays = np.empty((len(v), len(u), 2), np.float32)
        # Process a few rows at a time, because the temporary arrays are much larger than the rays.
        for part in slices(len(v), _PIECE // len(u)):
            pixels = np.stack(np.meshgrid(u, v[part]), axis=-1)
            with np.errstate(over="ignore"):
                rays[part] = self._flat(pixels.reshape(-1, 2)).reshape(pixels.shape)
        return rays

    def _distorted(self, flat: Floats) -> Floats:
        """Apply the lens distortion to points (N, 2) at depth 1."""
        if not any(self.coefficients):
            return flat
        count = DISTORTIONS[self.model]
        coefficients = np.array((*self.coefficients, *(0.0,) * count)[:count])
        if count != 8:
            fisheye = cv2.fisheye.distortPoints
            return fisheye(flat[None], np.eye(3), coefficients)[0] if len(flat) else flat
        # `cv2.projectPoints` is 20 times slower.
        k1, k2, p1, p2, k3, k4, k5, k6 = coefficients
        x, y = flat.T
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        radial /= 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        xy = 2 * x * y
        distorted = x * radial + p1 * xy + p2 * (r2 + 2 * x * x)
        return np.stack([distorted, y * radial + p2 * xy + p1 * (r2 + 2 * y * y)], axis=1)

    def _flat(self, pixels: Floats) -> Floats:
        """Undistort pixels (N, 2) to points (N, 2) at depth 1; NaN if the iteration fails."""
        # Damaged messages may contain focal lengths near zero.
        with np.errstate(all="ignore"):
            wanted: Floats = (pixels - self.center) / self.focal
            if not any(self.coefficients):
                return wanted
            flat = wanted.copy()
            for _ in range(ROUNDS):
                flat += wanted - self._distorted(flat)
            residue = np.abs((self._distorted(flat) - wanted) * self.focal).max(axis=1)
        flat[~(residue < LARGEST_RESIDUE)] = np.nan
        return flat

    @cached_property
    def _reach(self) -> float:
        """Largest distance from the optical axis at which a point at depth 1 is in the image.

        Beyond this distance, the distortion model may wrongly project points into the image.
        """
        height, width = self.size
        u, v = np.linspace(-0.5, width - 0.5, 50), np.linspace(-0.5, height - 0.5, 50)
        edges = [(u, np.full(50, y)) for y in (v[0], v[-1])]
        edges += [(np.full(50, x), v) for x in (u[0], u[-1])]
        border = np.concatenate([np.stack(edge, axis=1) for edge in edges])
        distances = np.linalg.norm(self._flat(border), axis=1)
        return float(np.max(distances, initial=0.0, where=np.isfinite(distances)))


def from_camera_info(message: Any) -> Camera:
    """Create a camera from a `CameraInfo`, including its binning and region of interest."""
    check_fields(message, "sensor_msgs/CameraInfo", "k", "distortion_model")
    matrix = np.asarray(message.k, np.float64).reshape(3, 3)
    fx, fy = matrix[0, 0], matrix[1, 1]
    if not (np.isfinite(matrix).all() and fx > 0 and fy > 0):
        expected = "finite numbers with positive focal lengths; calibrate the camera"
        raise MessageError("k", expected, matrix.ravel().tolist())
    coefficients = tuple(map(float, message.d))
    if not np.isfinite(coefficients).all():
        raise MessageError("d", "finite numbers", list(coefficients))
    model = message.distortion_model
    if any(coefficients) and model not in DISTORTIONS:
        raise MessageError("distortion_model", f"one of {', '.join(DISTORTIONS)}", model)
    roi, binning = message.roi, (max(message.binning_x, 1), max(message.binning_y, 1))
    size = [
        (part or whole) // step
        for part, whole, step in zip(
            (roi.height, roi.width), (message.height, message.width), binning[::-1], strict=True
        )
    ]
    for name, count in zip(("height", "width"), size, strict=True):
        if count < 1:
            raise MessageError(name, "at least one pixel", count)
    check_cells("camera_info", (size[0], size[1]))
    # Binning scales distances from the image edge, which is half a pixel from the first center.
    cx = (matrix[0, 2] - roi.x_offset + 0.5) / binning[0] - 0.5
    cy = (matrix[1, 2] - roi.y_offset + 0.5) / binning[1] - 0.5
    return Camera(
        (size[0], size[1]),
        (float(fx / binning[0]), float(fy / binning[1])),
        (float(cx), float(cy)),
        model if any(coefficients) else "plumb_bob",
        coefficients,
    )


@dataclass(frozen=True)
class Picture:
    """Decoded image, with the model of its camera.

    Attributes:
        frame_id: optical frame of the camera.
        stamp: time of the image [ns].
        pixels: (rows, cols, channels); color channels are in RGB order.
    """

    is_optical: ClassVar[bool] = True
    frame_id: str
    stamp: int
    pixels: npt.NDArray[Any]
    camera: Camera

    def __len__(self) -> int:
        return math.prod(self.pixels.shape[:2])


@dataclass
class CameraImages:
    """Decodes the images of one camera, and converts depth images to points.

    Attributes:
        stride: only every `stride`-th row and column of a depth image is used.
        topic: function that returns a description of the `CameraInfo` topic, for error messages.
    """

    stride: int = 1
    camera: Camera | None = None
    topic: Callable[[], str] = lambda: "camera_info"
    _rays: tuple[Camera, npt.NDArray[np.float32]] | None = None

    def take(self, message: Any) -> None:
        """Set the camera from a `CameraInfo`; see `from_camera_info`."""
        self.camera = from_camera_info(message)

    def read_picture(self, message: Any) -> Picture:
        """Decode an `Image`, or its serialized bytes."""
        if isinstance(message, bytes):
            message = view(message, Image)
        pixels, order = to_pixels(message)
        if self.camera is None:
            expected = f"a message before the first image, on {self.topic()}"
            raise MessageError("camera_info", expected, None)
        if pixels.shape[:2] != self.camera.size:
            expected = f"those of the camera, {self.camera.size}"
            raise MessageError("height, width", expected, pixels.shape[:2])
        if pixels.shape[2] >= 3:
            pixels = pixels[..., :3] if order == "rgb" else pixels[..., 2::-1]
        stamp = from_stamp(message.header.stamp)
        return Picture(message.header.frame_id, stamp, pixels, self.camera)

    def read_depths(self, message: Any) -> Cloud:
        """Convert a depth image (`Image` or its bytes) to points; skip invalid depths."""
        if isinstance(message, bytes):
            message = view(message, Image)
        picture = self.read_picture(message)
        pixels, camera = picture.pixels, picture.camera
        if pixels.shape[2] != 1 or pixels.dtype.itemsize == 1:
            raise MessageError("encoding", "16UC1, mono16, 32FC1 or 64FC1", message.encoding)
        if self._rays is None or self._rays[0] != camera:
            self._rays = camera, camera.rays(self.stride)
        rays = self._rays[1]
        with np.errstate(over="ignore"):
            depth = pixels[:: self.stride, :: self.stride, 0].astype(np.float32)
        if message.encoding in MILLIMETERS:
            depth *= np.float32(0.001)
        with np.errstate(invalid="ignore", over="ignore"):
            kept = (depth > 0) & (depth < np.inf) & np.isfinite(rays).all(axis=2)
            points = np.empty((int(kept.sum()), 3), np.float32)
            points[:, 2] = depth[kept]
            np.multiply(rays[kept], points[:, 2:], out=points[:, :2])
        missing = depth.size - len(points)
        return Cloud(picture.frame_id, picture.stamp, points, missing=missing, is_optical=True)


def seen_cells(
    grid_map: GridMap, layer: str, camera: Camera, transform: Matrix
) -> tuple[Cells, tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]]:
    """Return the map cells that a camera sees, and the pixels that show the cell centers.

    A cell is hidden if the line from its center to the camera passes below another cell.

    Args:
        layer: name of the height layer [m]. Cells without a height are invisible and hide nothing.
        transform: (4, 4) transform from the camera frame to the map frame.

    Returns:
        Cells and pixels, each as row indices and column indices.
    """
    heights = grid_map[layer]
    rows, columns = np.nonzero(np.isfinite(heights))
    x, y = grid_map.axes()
    points = np.stack([x[rows], y[columns], heights[rows, columns]], axis=1, dtype=np.float64)
    pixels = camera.project((points - transform[:3, 3]) @ transform[:3, :3])
    shown = np.flatnonzero(np.isfinite(pixels[:, 0]))
    shown = shown[~_hidden(grid_map, heights, points[shown], transform[:3, 3])]
    u, v = np.rint(pixels[shown]).astype(np.intp).T
    return (rows[shown], columns[shown]), (v, u)


def _hidden(grid_map: GridMap, heights: Any, points: Floats, eye: Floats) -> npt.NDArray[np.bool_]:
    """Return a mask (N,) of the points (N, 3) that map cells hide from `eye` (3,)."""
    hidden = np.zeros(len(points), bool)
    if not len(points):
        return hidden
    side, top = grid_map.resolution, float(np.nanmax(heights))
    way = eye - points
    distances = np.hypot(way[:, 0], way[:, 1])
    left = np.flatnonzero(distances > side)
    step = 0
    while len(left):
        step += 1
        share = step * side / distances[left]
        on_way = points[left] + share[:, None] * way[left]
        goes_on = (share < 1) & (on_way[:, 2] < top)
        left, on_way = left[goes_on], on_way[goes_on]
        cells, inside = grid_map.get_indices(on_way[:, :2])
        blocks = inside & (heights[cells] > on_way[:, 2] + OCCLUSION_TOLERANCE * side)
        hidden[left[blocks]] = True
        # The map is convex, so a line that has left it does not reenter.
        left = left[inside & ~blocks]
    return hidden
