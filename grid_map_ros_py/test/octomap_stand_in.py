# SPDX-License-Identifier: BSD-3-Clause
"""Stand-ins for octomap messages, and a simple writer of octrees."""

import array
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from std_msgs.msg import Header

Path = tuple[int, ...]
"""The children's numbers from the root down to a node."""


@dataclass
class Octomap:
    header: Header = field(default_factory=Header)
    binary: bool = True
    id: str = "OcTree"
    resolution: float = 0.1
    data: "array.array[int]" = field(default_factory=lambda: array.array("b"))


def message(data: bytes, **fields: object) -> Octomap:
    return Octomap(data=array.array("b", data), **fields)


def write_binary(leaves: Mapping[Path, bool], path: Path = ()) -> bytes:
    """Write an inner node and all below it; `leaves` says which leaves are occupied."""
    word, below = 0, b""
    for child in range(8):
        here = (*path, child)
        if here in leaves:
            word |= (2 if leaves[here] else 1) << 2 * child
        elif any(leaf[: len(here)] == here for leaf in leaves):
            word |= 3 << 2 * child
            below += write_binary(leaves, here)
    return struct.pack("<H", word) + below


def write_full(
    leaves: Mapping[Path, bool], payload: Callable[[bool], bytes], path: Path = ()
) -> bytes:
    """Write a node and its descendants; `payload` returns data that precedes the children."""
    if path in leaves:
        return payload(leaves[path]) + b"\0"
    mask, below = 0, b""
    for child in range(8):
        here = (*path, child)
        if any(leaf[: len(here)] == here for leaf in leaves):
            mask |= 1 << child
            below += write_full(leaves, payload, here)
    return payload(True) + bytes([mask]) + below
