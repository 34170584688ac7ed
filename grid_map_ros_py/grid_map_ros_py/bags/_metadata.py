# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Metadata of rosbag2 bags: `metadata.yaml`, read and written."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from grid_map_core_py.files import load_yaml

from ..errors import BagError
from ..messages._definition import TYPE_HASH

FILE_NAME = "metadata.yaml"
VERSION = 9
"""Version of the metadata that ROS 2 Jazzy writes."""

GRID_MAP_TYPE = "grid_map_msgs/msg/GridMap"

_UNLIMITED = {"sec": 9223372036, "nsec": 854775807}
QOS_PROFILES = [
    {
        # rosbag2 does not record the history either.
        "history": "unknown",
        "depth": 0,
        "reliability": "reliable",
        "durability": "transient_local",
        "deadline": _UNLIMITED,
        "lifespan": _UNLIMITED,
        "liveliness": "automatic",
        "liveliness_lease_duration": _UNLIMITED,
        "avoid_ros_namespace_conventions": False,
    }
]
"""Quality of service of map topics, which makes `ros2 bag play` publish them latched."""


@dataclass
class Contents:
    """Number of messages by topic in a new bag, and their first and last time [ns]."""

    counts: dict[str, int]
    first: int = 2**63 - 1
    last: int = 0

    @property
    def count(self) -> int:
        """Number of messages on all topics."""
        return sum(self.counts.values())

    def add(self, topic: str, time: int) -> None:
        """Count a message."""
        self.counts[topic] = self.counts.get(topic, 0) + 1
        self.first = min(self.first, time)
        self.last = max(self.last, time)


def ros_distro() -> str:
    """Return the ROS distribution that is named in new bags."""
    return os.environ.get("ROS_DISTRO", "jazzy")


def information(contents: Contents, file: str, storage: str) -> dict[str, Any]:
    """Return the metadata of a bag with one file of maps."""
    time = {
        "duration": {"nanoseconds": contents.last - contents.first},
        "starting_time": {"nanoseconds_since_epoch": contents.first},
        "message_count": contents.count,
    }
    return {
        "version": VERSION,
        "storage_identifier": storage,
        **time,
        "topics_with_message_count": [
            {"topic_metadata": _topic(name), "message_count": count}
            for name, count in contents.counts.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [{"path": file, **time}],
        "custom_data": None,
        "ros_distro": ros_distro(),
    }


def _topic(name: str) -> dict[str, Any]:
    return {
        "name": name,
        "type": GRID_MAP_TYPE,
        "serialization_format": "cdr",
        "offered_qos_profiles": QOS_PROFILES,
        "type_description_hash": TYPE_HASH,
    }


class _Dumper(yaml.SafeDumper):
    """Writes no aliases, which other readers may not know."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True


def dump(document: object) -> str:
    """Return a document as YAML."""
    text: str = yaml.dump(document, Dumper=_Dumper, sort_keys=False)
    return text


def save(folder: Path, document: object) -> None:
    """Write `information` as the metadata of a bag."""
    text = dump({"rosbag2_bagfile_information": document})
    (folder / FILE_NAME).write_text(text, encoding="utf-8")


def load_files(folder: Path) -> list[Path]:
    """Return the files with the messages of a bag, in the order in which they were recorded.

    Raises:
        BagError: the folder is no bag, its metadata is damaged, or its files are compressed.
    """
    path = folder / FILE_NAME
    found = _load(path)
    if str(found.get("compression_mode")).lower() == "file":
        raise BagError(
            folder,
            f"its files are compressed ({found.get('compression_format')}), which is not read; "
            "'ros2 bag convert' unpacks them",
        )
    names = found.get("relative_file_paths")
    if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
        raise BagError(path, "relative_file_paths: expected a list of names")
    if not names:
        raise BagError(path, "the bag has no files")
    # Old versions include the folder; paths to other folders are not followed.
    return [folder / Path(name).name for name in names]


def _load(path: Path) -> Mapping[str, Any]:
    if not path.is_file():
        raise BagError(path.parent, f"no bag: a folder without {FILE_NAME}{_hint(path.parent)}")
    document = load_yaml(path)
    found = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    if not isinstance(found, dict):
        raise BagError(path, "no metadata of a bag: 'rosbag2_bagfile_information' is missing")
    return found


def _hint(folder: Path) -> str:
    recordings = sorted(path.name for path in folder.iterdir() if path.suffix in (".mcap", ".db3"))
    return f"; name the file itself to read {recordings[0]}" if recordings else ""
