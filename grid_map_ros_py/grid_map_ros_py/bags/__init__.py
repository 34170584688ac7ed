# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Bags of rosbag2: read, write, list."""

from ._bag import (
    BagReader,
    BagRecord,
    BagTopic,
    BagWriter,
    bag_maps,
    bag_topics,
    load_from_bag,
    save_to_bag,
)
from ._mcap import COMPRESSIONS

__all__ = [
    "COMPRESSIONS",
    "BagReader",
    "BagRecord",
    "BagTopic",
    "BagWriter",
    "bag_maps",
    "bag_topics",
    "load_from_bag",
    "save_to_bag",
]
