# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps in bags of rosbag2, read and written without ROS: MCAP and sqlite3 files."""

from ._bag import (
    STORAGES,
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
    "STORAGES",
    "BagReader",
    "BagRecord",
    "BagTopic",
    "BagWriter",
    "bag_maps",
    "bag_topics",
    "load_from_bag",
    "save_to_bag",
]
