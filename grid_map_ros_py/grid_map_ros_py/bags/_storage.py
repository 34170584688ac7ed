# SPDX-License-Identifier: BSD-3-Clause
"""Types and functions shared by the readers and writers of MCAP and sqlite3 bags."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files._shared import load_yaml, parse_yaml

from ..errors import BagError
from ..messages._definition import DEFINITION, TYPE_HASH

GRID_MAP_TYPE = "grid_map_msgs/msg/GridMap"


class Topic(NamedTuple):
    """Type and encoding of the messages on a topic.

    `qos` lists the profiles of the publishers in YAML. `type_hash` is defined in REP-2011.
    """

    type: str
    encoding: str
    qos: str = ""
    definition: str = ""
    type_hash: str = ""


class Entry(NamedTuple):
    """Time [ns] and location of a message in a bag file. In sqlite3, the location is a row ID."""

    time: int
    place: Any


@contextmanager
def bag_errors(path: Path, doing: str = "read") -> Iterator[None]:
    """Convert exceptions other than `GridMapError` to a `BagError` that names the file."""
    try:
        yield
    except GridMapError:
        raise
    except OSError as error:
        raise BagError(path, f"cannot be {doing}: {error.strerror or error}") from error
    # Damaged data may cause any exception in the packages that read bags.
    except Exception as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise BagError(path, f"cannot be {doing}: {text}") from error


# --- metadata -------------------------------------------------------------------------------------

FILE_NAME = "metadata.yaml"
VERSION = 9
"""Version of the bag metadata format in ROS 2 Jazzy."""


def ros_distro() -> str:
    """Return the ROS distribution to record in new bags."""
    return os.environ.get("ROS_DISTRO", "jazzy")


def information(
    topics: Mapping[str, Topic], times: Mapping[str, list[int]], file: str, storage: str
) -> dict[str, Any]:
    """Return the metadata of a single-file bag, given the message times [ns] of each topic."""
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
                    "type": topics[name].type,
                    "serialization_format": topics[name].encoding,
                    "offered_qos_profiles": parse_yaml(topics[name].qos, name),
                    "type_description_hash": topics[name].type_hash,
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


def dump(document: object) -> str:
    """Serialize a document to YAML without aliases, which some readers do not support."""
    text: str = yaml.safe_dump(json.loads(json.dumps(document)), sort_keys=False)
    return text


_UNLIMITED = {"sec": 9223372036, "nsec": 854775807}


def qos_profile(*, reliable: bool, latched: bool) -> dict[str, Any]:
    """Return the quality-of-service profile of a publisher as rosbag2 stores it."""
    return {
        # rosbag2 does not record the history either.
        "history": "unknown",
        "depth": 0,
        "reliability": "reliable" if reliable else "best_effort",
        "durability": "transient_local" if latched else "volatile",
        "deadline": _UNLIMITED,
        "lifespan": _UNLIMITED,
        "liveliness": "automatic",
        "liveliness_lease_duration": _UNLIMITED,
        "avoid_ros_namespace_conventions": False,
    }


MAPS = Topic(
    GRID_MAP_TYPE, "cdr", dump([qos_profile(reliable=True, latched=True)]), DEFINITION, TYPE_HASH
)
"""Type, encoding and QoS of map topics in new bags; `ros2 bag play` latches these topics."""


def save(folder: Path, document: object) -> None:
    """Write the result of `information` to the metadata file of a bag folder."""
    text = dump({"rosbag2_bagfile_information": document})
    with (folder / FILE_NAME).open("x", encoding="utf-8") as file:
        file.write(text)


def files_of(path: Path, *, recover: bool = False) -> list[Path]:
    """Return the files of a bag in recording order; with `recover`, metadata may be missing."""
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise BagError(path, "a device or a pipe" if path.exists() else "no such file or folder")
    if (path / FILE_NAME).is_file():
        # In old metadata versions, file names include the folder name.
        files = [path / Path(name).name for name in _listed_files(path)]
        for file in files:
            if not file.is_file():
                raise BagError(path, f"its file {file.name} is missing")
        return files
    files = [file for file in path.iterdir() if file.suffix in (".mcap", ".db3")]
    # File names end in numbers without leading zeros, so shorter names come first.
    files.sort(key=lambda file: (len(file.name), file.name))
    if recover:
        return [file for file in files if file.stat().st_size]
    hint = f"; read {files[0].name} itself, or use recover=True (--recover)" if files else ""
    raise BagError(path, f"not a bag: a folder without {FILE_NAME}{hint}")


def _listed_files(folder: Path) -> list[str]:
    path = folder / FILE_NAME
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
    if not (names and isinstance(names, list) and all(isinstance(name, str) for name in names)):
        raise BagError(path, "relative_file_paths: expected a list of names")
    return names
