# SPDX-License-Identifier: BSD-3-Clause
"""Registers Rerun recordings as a file format of `grid_map_core_py`."""

from collections.abc import Iterable
from os import PathLike

from grid_map_core_py import GridMap
from grid_map_core_py._arrays._checks import select_layers
from grid_map_core_py.files import Format
from grid_map_core_py.files._shared import say_crs_is_lost

_TOPIC = "/grid_map"


def _save(
    grid_map: GridMap,
    path: str | PathLike[str],
    *,
    topic: str = _TOPIC,
    height_layer: str = "",
    color_layer: str = "",
    exaggeration: float = 1.0,
) -> None:
    from ._rerun.recording import recorded
    from ._rerun.scene import Style

    say_crs_is_lost(grid_map, "a recording of Rerun", stacklevel=4)
    style = Style(height_layer=height_layer, color_layer=color_layer, exaggeration=exaggeration)
    select_layers(grid_map.layers, [*filter(None, (height_layer, color_layer))])
    with recorded(path, style) as scene:
        scene.log_map(topic, grid_map)


def _save_maps(
    path: str | PathLike[str], maps: Iterable[tuple[int | None, GridMap]], *, topic: str = _TOPIC
) -> int:
    from ._rerun.recording import recorded

    count = 0
    with recorded(path) as scene:
        for time, grid_map in maps:
            say_crs_is_lost(grid_map, "a recording of Rerun", stacklevel=4)
            scene.log_map(topic, grid_map, log_time=time)
            count += 1
    return count


def _save_all(
    source: str | PathLike[str], path: str | PathLike[str], *, recover: bool = False
) -> int:
    from ._rerun.recording import log_bag, recorded

    with recorded(path) as scene:
        return log_bag(scene, source, recover=recover)


RRD = Format(
    name="rrd",
    description="recording of Rerun, any number of maps",
    endings=(".rrd",),
    save=_save,
    save_maps=_save_maps,
    save_all=_save_all,
)
