# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Metadata of a map as JSON values."""

from collections.abc import Iterable
from typing import Any

from ..map._grid_map import GridMap


def map_facts(
    grid_map: GridMap,
    layers: Iterable[str] | None = None,
    basic_layers: Iterable[str] | None = None,
) -> dict[str, Any]:
    """Return frame, time, size, place and names of layers of a map, as JSON has them.

    Args:
        grid_map: the map, perhaps without its layers.
        layers, basic_layers: names to list in place of the names of the map.
    """
    return {
        "frame_id": grid_map.frame_id,
        "timestamp": grid_map.timestamp,
        "size": [*grid_map.size],
        "resolution": grid_map.resolution,
        "length": grid_map.length.tolist(),
        "position": grid_map.position.tolist(),
        "start_index": [*grid_map.start_index],
        "layers": [*(grid_map.layers if layers is None else layers)],
        "basic_layers": [*(grid_map.basic_layers if basic_layers is None else basic_layers)],
    }
