# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map info`: what files tell about their maps."""

import argparse
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import add_choice_of_map, add_json, add_source
from .formats import STANDARD, Format, format_of_source
from .output import byte_count, coordinate, number, print_json, print_table, shown

if TYPE_CHECKING:
    from grid_map_ros_py import BagTopic

    from .reading import MapInfo

SECOND = 1_000_000_000
"""In nanoseconds."""

HELP = "show what is in a file: topics, layers, size, place and time"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what `run` needs."""
    add_source(parser, "a bag, .npz, folder of images, GeoTIFF, point cloud or mesh")
    add_choice_of_map(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Print it."""
    show = {Format.BAG: _show_bag, Format.CLOUD: _show_cloud}
    show.get(format_of_source(options.source), _show_map)(options)
    return 0


def _show_map(options: argparse.Namespace) -> None:
    from .reading import map_info

    info = map_info(options.source, options.topic, options.index)
    if options.json:
        print_json(_head(options.source) | {"map": info.as_dict()})
    else:
        _print_head(options.source)
        _print_map(info)


def _show_bag(options: argparse.Namespace) -> None:
    from grid_map_ros_py import bag_topics

    from .bags import maps_in_bag

    topics = bag_topics(options.source)
    chosen = [one for one in topics if options.topic in (None, one.name)]
    index = -1 if options.index is None else options.index
    if options.topic is not None and not chosen:
        from grid_map_ros_py.bags import BagReader

        BagReader(options.source, options.topic)  # raises: there is no such topic
    maps = dict(maps_in_bag(options.source, chosen, index))
    if options.json:
        entries = [
            asdict(one) | ({"map": maps[one.name].as_dict()} if one.name in maps else {})
            for one in chosen
        ]
        print_json(_head(options.source) | {"topics": entries})
        return
    _print_head(options.source, _span(chosen))
    rows = [
        (shown(one.name), shown(one.type), str(one.count), _seconds(one.first), _seconds(one.last))
        for one in chosen
    ]
    print_table([("topic", "type", "messages", "first", "last"), *rows], numbers=(2,))
    for name, info in maps.items():
        print(f"\n{shown(name)}, {'last map' if options.index is None else f'map {index}'}")
        _print_map(info)


def _show_cloud(options: argparse.Namespace) -> None:
    from .clouds import cloud_info
    from .reading import checked_format

    checked_format(options.source, options.topic, options.index)
    info = cloud_info(options.source)
    if options.json:
        print_json(_head(options.source) | info)
        return
    _print_head(options.source)
    # Beyond the micrometre there is the noise of float32.
    lower, upper = (
        ", ".join(coordinate(round(value, 6)) for value in info[side])
        for side in ("lower", "upper")
    )
    print_table(
        [
            ("points", str(info["points"])),
            ("faces", str(info["faces"])),
            ("fields", shown(", ".join(info["fields"]))),
            ("extent", f"({lower}) to ({upper})"),
        ]
    )


def _head(source: str) -> dict[str, Any]:
    return {"path": source, "format": format_of_source(source).value, "bytes": _size(source)}


def _print_head(source: str, more: str = "") -> None:
    head = _head(source)
    size = "" if head["bytes"] is None else byte_count(head["bytes"])
    print(f"{shown(source)}: {', '.join(filter(None, (head['format'], size, more)))}")


def _span(topics: "list[BagTopic]") -> str:
    """Return how long the messages of topics take, and from when on."""
    first = min((one.first for one in topics if one.first is not None), default=None)
    last = max((one.last for one in topics if one.last is not None), default=None)
    if first is None or last is None:
        return ""
    return f"{number((last - first) / SECOND)} s from {_date(first) or _seconds(first)}"


def _size(source: str) -> int | None:
    path = Path(source)
    if source == STANDARD:
        return None
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())


def _print_map(info: "MapInfo") -> None:
    geometry = info.geometry
    rows, columns = geometry.size
    x, y = map(coordinate, geometry.position)
    length_x, length_y = map(coordinate, geometry.length)
    basic = set(info.basic_layers)
    layers = [f"{shown(name)}{' (basic)' if name in basic else ''}" for name in info.layers]
    lines = [
        ("frame", shown(info.frame_id)),
        ("time", _time(info.timestamp)),
        ("size", f"{rows} x {columns} cells of {coordinate(geometry.resolution)} m"),
        ("length", f"{length_x} x {length_y} m"),
        ("position", f"({x}, {y})"),
        ("layers", ", ".join(layers)),
    ]
    if info.crs:
        lines.insert(1, ("crs", shown(info.crs)))
    if any(info.start_index):
        lines.insert(-1, ("start index", str(info.start_index)))
    print_table(lines)


def _time(nanoseconds: int) -> str:
    date = _date(nanoseconds)
    return f"{_seconds(nanoseconds)} ({date})" if date else _seconds(nanoseconds)


def _seconds(nanoseconds: int | None) -> str:
    if nanoseconds is None:
        return ""
    seconds, rest = divmod(nanoseconds, SECOND)
    return f"{seconds}.{rest:09} s"


def _date(nanoseconds: int) -> str:
    """Return a time as a date if it can be one of today's clocks."""
    seconds = nanoseconds // SECOND
    if not 10**9 <= seconds < 2**32:
        return ""
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S} UTC"
