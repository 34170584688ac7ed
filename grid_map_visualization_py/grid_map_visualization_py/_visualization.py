# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Protocol of visualizations: callables that turn a map into a message."""

from typing import Any, ClassVar, Protocol

from grid_map_core_py import GridMap


class Visualization(Protocol):
    """A frozen dataclass whose fields are its YAML parameters, called with a map.

    Attributes:
        message_type: class of the messages that it makes.
    """

    message_type: ClassVar[type]

    def __call__(self, grid_map: GridMap) -> Any:
        """Return a message of `message_type`, or its CDR bytes: publishers accept both.

        Raises:
            LayerNotFoundError: the map lacks a layer.
        """
