# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Files of OctoMap, binary (.bt) or full (.ot).

Some lines of text come first, then the tree in the very bytes that messages hold:

    # Octomap OcTree binary file
    # comments
    id OcTree
    size 1234
    res 0.05
    data
"""

from dataclasses import dataclass
from pathlib import Path

from std_msgs.msg import Header

from grid_map_core_py.errors import ConfigError

BINARY, FULL = b"# Octomap OcTree binary file", b"# Octomap OcTree file"
"""First lines."""


@dataclass
class Octomap:
    """An octomap from a file, with the fields of `octomap_msgs/Octomap`; no message class."""

    header: Header
    binary: bool
    id: str
    resolution: float
    data: bytes


def read_octomap(path: Path, frame_id: str) -> Octomap:
    """Return the octomap of a file; the tree itself is not looked at.

    Raises:
        ConfigError: the file cannot be read, or does not begin like one of OctoMap.
    """
    try:
        head, separator, tree = path.read_bytes().partition(b"\ndata\n")
    except OSError as error:
        raise ConfigError(f"octomap {str(path)!r}: {error.strerror}") from error
    kind, *lines = head.splitlines() or [b""]
    if not (separator and kind in (BINARY, FULL)):
        raise ConfigError(f"octomap {str(path)!r}: expected a .bt or .ot file of OctoMap")
    entries = dict(line.partition(b" ")[::2] for line in lines if not line.startswith(b"#"))
    try:
        name, resolution = entries[b"id"].decode(), float(entries[b"res"])
    except (KeyError, ValueError) as error:
        raise ConfigError(f"octomap {str(path)!r}: its head lacks 'id' or 'res'") from error
    return Octomap(Header(frame_id=frame_id), kind == BINARY, name, resolution, tree)
