# SPDX-License-Identifier: BSD-3-Clause
"""Readers of elevation mapping for fuzz.py: poses with covariances, cameras, depths and scans."""

import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image, PointCloud2

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.elevation import ElevationMapper
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, to_color_image, to_image, to_message, to_point_cloud
from grid_map_ros_py._elevation_mapping.cameras import CameraImages, from_camera_info
from grid_map_ros_py._elevation_mapping.fusion import ElevationFusion
from grid_map_ros_py._elevation_mapping.sources import (
    InputSource,
    SourceSettings,
    sensor_processor,
)
from grid_map_ros_py.messages import serialize, view
from grid_map_ros_py.nodes._poses import Placement, PoseHistory
from grid_map_ros_py.nodes._scans import read_cloud


def targets(grid_map: GridMap) -> Iterator[tuple[str, tuple[Any, ...], Callable[[Any], Any]]]:
    """Yield names, intact inputs and readers; the map has 7 x 5 cells and colors."""
    grid_map.timestamp = 10**9  # Clouds without a time are dropped.
    cloud = to_point_cloud(grid_map, "elevation")
    yield "Odometry", (_odometry(),), _read_pose
    yield (
        "Odometry in CDR",
        (serialize(_odometry()),),
        lambda data: _read_pose(view(data, Odometry)),
    )
    yield "PoseWithCovarianceStamped", (_uncertain_pose(),), _read_uncertain_pose
    yield "CameraInfo", (_camera_info(),), _read_camera
    yield "depth image", (to_image(grid_map, "elevation", "32FC1"),), _read_depths
    yield "image of a camera", (to_color_image(grid_map, "color", "rgb8"),), _paint_image
    yield "map for masked_replace", (to_message(grid_map),), _replace_cells
    yield "cloud of a lidar", (cloud,), _map_cloud
    yield "cloud of a lidar in CDR", (serialize(cloud),), _map_cloud


def _odometry() -> Odometry:
    odometry = Odometry()
    odometry.header.frame_id = "odom"
    odometry.header.stamp.sec = 3
    odometry.pose.pose.orientation.x, odometry.pose.pose.orientation.w = 0.6, 0.8
    return odometry


def _read_pose(odometry: Odometry) -> Any:
    history = PoseHistory("odom")
    history.add(odometry)
    pose = history.at(0)
    assert np.isfinite(pose).all()
    return pose


def _uncertain_pose() -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.header.frame_id, message.header.stamp.sec = "map", 3
    message.pose.pose.orientation.w = 1.0
    message.pose.covariance = np.diag(np.arange(1.0, 7.0)).ravel()
    return message


def _read_uncertain_pose(message: PoseWithCovarianceStamped) -> Any:
    history = PoseHistory("map", with_covariances=True)
    history.add(message)
    placement = history.place("lidar", 0)
    assert placement is not None
    return placement.covariance


def _camera_info() -> CameraInfo:
    message = CameraInfo(height=7, width=5, distortion_model="plumb_bob", d=[-0.2, 0.1, 0, 0, 0])
    message.k = np.array([4.0, 0, 2, 0, 4.0, 3, 0, 0, 1])
    return message


def _read_camera(message: CameraInfo) -> Any:
    return from_camera_info(message).rays(100)


def _read_depths(message: Image) -> Any:
    return CameraImages(1, from_camera_info(_camera_info())).read_depths(message).points


def _map_cloud(message: PointCloud2) -> GridMap:
    """Return the elevation map of a cloud that is seen from 1 m above its frame."""
    fusion, pose = _fusion(), np.eye(4)
    pose[2, 3] = 1.0
    with warnings.catch_warnings():
        # A time before that of the last scan.
        warnings.simplefilter("ignore")
        fusion.fuse(_source(), read_cloud(message, ["rgb"]), Placement(pose))
    return fusion.grid_map


def _paint_image(message: Image) -> GridMap:
    """Return a flat map with the pixels of a camera that looks down from 1 m above it."""
    fusion, pose = _flat(), np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = 1.0
    images = CameraImages(1, from_camera_info(_camera_info()))
    fusion.paint(_source(), images.read_picture(message), Placement(pose))
    return fusion.grid_map


def _replace_cells(message: GridMapMessage) -> GridMap:
    fusion = _flat()
    fusion.replace(from_message(message, unwrap=False), "variance")
    return fusion.grid_map


def _flat() -> ElevationFusion:
    fusion = _fusion()
    fusion.lay_patch(np.eye(4), (0.7, 0.5), 0.0, 0.01)
    return fusion


def _fusion() -> ElevationFusion:
    return ElevationFusion(ElevationMapper(GridGeometry(np.array([0.7, 0.5]), 0.1), "map"))


def _source() -> InputSource:
    return InputSource("lidar", SourceSettings(topic="/points"), sensor_processor({}))
