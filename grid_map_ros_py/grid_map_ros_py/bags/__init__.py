# SPDX-License-Identifier: BSD-3-Clause
"""Maps in bags of rosbag2, read and written without ROS: MCAP and sqlite3 files.

New bags are folders with `metadata.yaml` and one file, as `ros2 bag record` of ROS 2 Jazzy writes
them. Bags of either format are read, split or not, and single files. All functions raise `BagError`
for a bag that cannot be read or written, and `MissingPackageError` if the package `mcap` is needed
and not installed.
"""

from ._bag import (
    BagMessage as BagMessage,
    BagReader as BagReader,
    BagTopic as BagTopic,
    BagWriter as BagWriter,
    bag_maps as bag_maps,
    bag_messages as bag_messages,
    bag_topics as bag_topics,
    load_from_bag as load_from_bag,
    save_to_bag as save_to_bag,
)

__all__ = [name for name in dir() if not name.startswith("_")]
