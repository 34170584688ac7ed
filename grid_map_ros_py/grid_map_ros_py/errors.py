# SPDX-License-Identifier: BSD-3-Clause
"""Error classes of this package.

GridMapError (grid_map_core_py)
├── BagError
├── MessageError (ValueError)
├── MissingPackageError (grid_map_core_py)
├── NodeFailedError
├── RequestError
└── TiltedFrameError
"""

from grid_map_core_py.errors import GridMapError, MissingPackageError, short

__all__ = [
    "BagError",
    "MessageError",
    "MissingPackageError",
    "NodeFailedError",
]

DROPPED = (GridMapError, MemoryError)
"""Errors after which a node drops the message and continues."""


def reason(error: Exception) -> str:
    """Return the message of an error, or "out of memory" if the message is empty."""
    return str(error) or "out of memory"


class MessageError(GridMapError, ValueError):
    """A message is invalid, or a value cannot be stored in a message.

    Attributes:
        field: path of the field in the message, such as `data[0].layout.dim[1].size`.
        expected: description of a correct value.
        found: actual value.
    """

    def __init__(self, field: str, expected: str, found: object) -> None:
        self.field = field
        self.expected = expected
        self.found = found
        super().__init__(field, expected, found)

    def whole_text(self) -> str:
        return f"{self.field}: expected {self.expected}, got {short(self.found)}"


class BagError(GridMapError):
    """The bag file or bag folder `path` cannot be read or written."""

    def __init__(self, path: object, reason: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(path, reason)

    def whole_text(self) -> str:
        return f"{self.path}: {self.reason}"


class NodeFailedError(GridMapError):
    """Raise this error in a callback to end the node. `run` then logs the error and returns 1."""


class RequestError(GridMapError):
    """A service request is rejected; the message gives the reason."""


class TiltedFrameError(GridMapError):
    """The roll or pitch of a frame is too large. Nodes log this error as a warning."""
