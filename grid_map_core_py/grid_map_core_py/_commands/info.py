# SPDX-License-Identifier: BSD-3-Clause
"""Show the contents of a file: topics, layers, size, position and time."""

import argparse
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from ._arguments import add_json, add_source
from ._maps import describe
from ._output import byte_count, coordinate, message, number, print_json, print_table, shown

SECOND = 1_000_000_000
"""Nanoseconds in a second."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_source(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    if (part := Path(f"{Path(options.source)}.part")).is_dir():
        message(f"{part} is left from a run that did not finish; --resume continues it")
    facts = describe(options)
    if options.json:
        print_json(facts)
        return 0
    topics = facts.get("topics", [])
    size = "" if facts["bytes"] is None else byte_count(facts["bytes"])
    head = ", ".join(filter(None, (facts["format"], size, _span(topics))))
    print(f"{shown(facts['path'])}: {head}")
    if "map" in facts:
        _print_map(facts["map"])
    elif "points" in facts:
        _print_cloud(facts)
    else:
        rows = [
            (
                *(shown(topic["name"]), shown(topic["type"]), str(topic["count"])),
                *(_seconds(topic["first"]), _seconds(topic["last"])),
            )
            for topic in topics
        ]
        print_table([("topic", "type", "messages", "first", "last"), *rows], numbers=(2,))
        which = "last map" if options.index is None else f"map {options.index}"
        for topic in topics:
            if "map" in topic:
                print(f"\n{shown(topic['name'])}, {which}")
                _print_map(topic["map"])
    return 0


def _print_cloud(facts: dict[str, Any]) -> None:
    # Digits below a micrometer are float32 rounding noise.
    lower, upper = (
        ", ".join(coordinate(round(value, 6)) for value in facts[side])
        for side in ("lower", "upper")
    )
    print_table(
        [
            ("points", str(facts["points"])),
            ("faces", str(facts["faces"])),
            ("fields", shown(", ".join(facts["fields"]))),
            ("extent", f"({lower}) to ({upper})"),
        ]
    )


def _span(topics: list[dict[str, Any]]) -> str:
    first = min((one["first"] for one in topics if one["first"] is not None), default=None)
    last = max((one["last"] for one in topics if one["last"] is not None), default=None)
    if first is None or last is None:
        return ""
    return f"{number((last - first) / SECOND)} s from {_date(first) or _seconds(first)}"


def _print_map(info: dict[str, Any]) -> None:
    rows, columns = info["size"]
    x, y = map(coordinate, info["position"])
    length_x, length_y = map(coordinate, info["length"])
    basic = set(info["basic_layers"])
    layers = [f"{shown(name)}{' (basic)' if name in basic else ''}" for name in info["layers"]]
    lines = [
        ("frame", shown(info["frame_id"])),
        ("time", _time(info["timestamp"])),
        ("size", f"{rows} x {columns} cells of {coordinate(info['resolution'])} m"),
        ("length", f"{length_x} x {length_y} m"),
        ("position", f"({x}, {y})"),
        ("layers", ", ".join(layers)),
    ]
    if "crs" in info:
        lines.insert(1, ("crs", shown(info["crs"])))
    if "origin" in info:
        east, north = map(coordinate, info["origin"])
        lines.insert(2, ("origin", f"({east}, {north}) in the crs"))
    if "chunks" in info:
        lines.insert(-1, ("chunks", "{} x {} cells".format(*info["chunks"])))
    if any(info["start_index"]):
        lines.insert(-1, ("start index", str(tuple(info["start_index"]))))
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
    """Format a time [ns] as a date, or return "" outside the years 2001 to 2106."""
    seconds = nanoseconds // SECOND
    if not 10**9 <= seconds < 2**32:
        return ""
    return f"{datetime.fromtimestamp(seconds, timezone.utc):%Y-%m-%d %H:%M:%S} UTC"
