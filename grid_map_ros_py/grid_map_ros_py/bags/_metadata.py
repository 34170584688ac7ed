# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Metadata of rosbag2 bags: `metadata.yaml`, read and written."""

import os
from collections.abc import Mapping
from itertools import chain
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


def ros_distro() -> str:
    """Return the ROS distribution that is named in new bags."""
    return os.environ.get("ROS_DISTRO", "jazzy")


def information(times: Mapping[str, list[int]], file: str, storage: str) -> dict[str, Any]:
    """Return the metadata of a bag with one file of maps; `times` are [ns] by topic."""
    every = list(chain(*times.values()))
    time = {
        "duration": {"nanoseconds": max(every) - min(every)},
        "starting_time": {"nanoseconds_since_epoch": min(every)},
        "message_count": len(every),
    }
    return {
        "version": VERSION,
        "storage_identifier": storage,
        **time,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": name,
                    "type": GRID_MAP_TYPE,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": QOS_PROFILES,
                    "type_description_hash": TYPE_HASH,
                },
                "message_count": len(stamps),
            }
            for name, stamps in times.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [{"path": file, **time}],
        "custom_data": None,
        "ros_distro": ros_distro(),
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
    if not path.is_file():
        files = sorted(file.name for file in folder.iterdir() if file.suffix in (".mcap", ".db3"))
        hint = f"; name the file itself to read {files[0]}" if files else ""
        raise BagError(folder, f"no bag: a folder without {FILE_NAME}{hint}")
    document = load_yaml(path)
    found = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    if not isinstance(found, dict):
        raise BagError(path, "no metadata of a bag: 'rosbag2_bagfile_information' is missing")
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
