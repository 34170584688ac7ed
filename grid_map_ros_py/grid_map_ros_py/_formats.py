# SPDX-License-Identifier: BSD-3-Clause
"""Definitions of the file formats `bag` and `octomap` for `grid_map_core_py.files`."""

from collections.abc import Iterable
from dataclasses import asdict
from os import PathLike
from typing import Any, cast

from grid_map_core_py import GridMap
from grid_map_core_py.files import Format
from grid_map_core_py.files._shared import map_facts

from .bags import BagReader, BagWriter, bag_topics, load_from_bag
from .messages import load_octomap


def _describe_bag(
    path: str | PathLike[str], *, topic: str | None = None, index: int = -1, recover: bool = False
) -> dict[str, Any]:
    """Describe the topics of a bag and, for each topic with maps, the map at `index`."""
    chosen = [one for one in bag_topics(path, recover=recover) if topic in (None, one.name)]
    if topic is not None and not chosen:
        BagReader(path, topic, recover=recover)  # raises an error that lists the topics
    topics = []
    for one in chosen:
        facts = asdict(one)
        if one.holds_maps:
            with BagReader(path, one.name, recover=recover) as bag:
                facts["map"] = map_facts(bag[index].grid_map(unwrap=False))
        topics.append(facts)
    return {"topics": topics}


def _save_bag(
    grid_map: GridMap,
    path: str | PathLike[str],
    *,
    topic: str = "/grid_map",
    compress: bool = False,
    storage: str = "auto",
) -> None:
    _save_maps(path, [(None, grid_map)], topic=topic, compress=compress, storage=storage)


def _save_maps(
    path: str | PathLike[str],
    maps: Iterable[tuple[int | None, GridMap]],
    *,
    topic: str,
    compress: bool = False,
    storage: str = "auto",
) -> int:
    count = 0
    compression = "zstd" if compress else "none"
    with BagWriter(path, storage=storage, compression=compression) as bag:
        for time, grid_map in maps:
            bag.write(topic, grid_map, time=time)
            count += 1
            del grid_map
    return count


BAG = Format(
    name="bag",
    description="bag of rosbag2, any number of maps",
    endings=(".mcap", ".db3"),
    reads=lambda path: (
        not (path / "map.yaml").exists()
        if path.is_dir()
        else path.suffix.lower() in (".mcap", ".db3")
    ),
    writes=lambda path: not path.suffix,
    load=load_from_bag,
    save=_save_bag,
    describe=_describe_bag,
    open_maps=cast(Any, BagReader),
    save_maps=_save_maps,
)

OCTOMAP = Format(
    name="octomap", description="surface of an octomap", endings=(".bt", ".ot"), load=load_octomap
)
