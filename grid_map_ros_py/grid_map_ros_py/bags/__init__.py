# SPDX-License-Identifier: BSD-3-Clause
"""Read and write maps in rosbag2 bags (MCAP and sqlite3) without ROS.

New bags are folders with `metadata.yaml` and one storage file, as written by `ros2 bag record` in
ROS 2 Jazzy. Readers accept bags in both formats, including split bags, and single storage files.
All functions raise `BagError` if a bag cannot be read or written. For MCAP bags, they raise
`MissingPackageError` if neither the package `mcap` nor `rosbag2_py` is installed.
"""

from grid_map_core_py import _lazy

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

__all__, __dir__ = _lazy.public_names(dir())
