# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of octree conversions; the C++ library was not timed."""

import array
import struct
from types import SimpleNamespace

import numpy as np
import pytest
from std_msgs.msg import Header

from grid_map_ros_py import from_octomap, octomap_to_points


def slab(depth):
    """Return a binary subtree with a square layer of 2**depth x 2**depth occupied voxels."""
    if depth == 1:
        return struct.pack("<H", 0xAA)
    return struct.pack("<H", 0xFF) + 4 * slab(depth - 1)


def octomap(depth):
    # The path from the root to the octant with positive coordinates, then down at the origin.
    way = struct.pack("<H", 3 << 14) + struct.pack("<H", 3) * (15 - depth)
    data = array.array("b", way + slab(depth))
    return SimpleNamespace(header=Header(), binary=True, id="OcTree", resolution=0.1, data=data)


@pytest.mark.parametrize("depth", [8, 10])
def test_from_octomap(measure, depth):
    message = octomap(depth)
    grid_map = measure("fromOctomap", 2**depth, lambda: from_octomap(message))
    assert grid_map.size == (2**depth, 2**depth)
    assert (grid_map["elevation"] == np.float32(0.05)).all()


@pytest.mark.parametrize("depth", [8, 10])
def test_octomap_to_points(measure, depth):
    message = octomap(depth)
    points = measure("octomapToPoints", 2**depth, lambda: octomap_to_points(message))
    assert len(np.unique(points, axis=0)) == 4**depth
