# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the maps in bags tell; needs the message packages of ROS."""

from collections.abc import Iterable, Iterator

from grid_map_ros_py import BagReader, BagRecord, BagTopic, ReceivedMap

from .reading import MapInfo, info_of


def maps_in_bag(path: str, topics: Iterable[BagTopic], index: int) -> Iterator[tuple[str, MapInfo]]:
    """Yield every topic of maps, and what is told by one of them.

    Raises:
        GridMapError: it cannot be read, or there is no such map.
    """
    for topic in topics:
        if topic.holds_maps:
            with BagReader(path, topic.name) as bag:
                yield topic.name, record_info(bag[index])


def record_info(record: BagRecord) -> MapInfo:
    """Return what a message tells; no layer is copied."""
    received = ReceivedMap(record.data)
    info = info_of(record.grid_map((), unwrap=False))
    return info._replace(layers=received.layers, basic_layers=received.basic_layers)
