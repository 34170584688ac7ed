# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Arguments that several commands have, and how shells complete them."""

import argparse
from collections.abc import Callable
from contextlib import suppress
from typing import Any

SOURCES = "a bag (folder, .mcap, .db3), .npz, folder of images, GeoTIFF, or - for .npz from a pipe"


def add_source(parser: argparse.ArgumentParser, help: str = SOURCES) -> None:  # noqa: A002
    """Add the file to read, and which map of it."""
    parser.add_argument("source", help=help)


def add_choice_of_map(parser: argparse.ArgumentParser, which: str = "the last one") -> None:
    """Add which map of a bag to take."""
    group = parser.add_argument_group("bags")
    topic = group.add_argument("--topic", help="of the maps, where the bag has several")
    completed(topic, complete_topics)
    group.add_argument(
        "--index", type=int, help=f"which map, 0 is the first, -1 the last ({which})"
    )


def add_layers(parser: argparse.ArgumentParser, what: str) -> None:
    """Add names of layers."""
    action = parser.add_argument(
        "--layer", dest="layers", metavar="LAYER", action="append", help=f"{what}; may be repeated"
    )
    completed(action, complete_layers)


def add_destination(parser: argparse.ArgumentParser) -> None:
    """Add the file to write, and how."""
    parser.add_argument(
        "destination",
        help="a name without ending (a bag), .npz, .tif, FOLDER/map.yaml, or - for .npz to a pipe",
    )
    group = parser.add_argument_group("output")
    group.add_argument("-f", "--force", action="store_true", help="replace what is there")
    group.add_argument(
        "--to", choices=("bag", "npz", "images", "geotiff"), help="format, whatever the name"
    )
    group.add_argument("--compress", action="store_true", help="make files smaller (not images)")
    group.add_argument("--bits", type=int, choices=(8, 16), help="of images (16)")
    group.add_argument(
        "--crs", default="", help="of a GeoTIFF, such as EPSG:25832 (that of a GeoTIFF source)"
    )
    group.add_argument("--output-topic", metavar="TOPIC", help="of the maps in a new bag")


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add the choice of JSON."""
    parser.add_argument("--json", action="store_true", help="print JSON")


# --- completion -----------------------------------------------------------------------------------


Completer = Callable[..., list[str]]


def completed(action: argparse.Action, completer: Completer) -> None:
    """Let shells complete an argument; argcomplete asks its `completer`."""
    action.completer = completer  # type: ignore[attr-defined]


def complete_layers(parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    """Return the layers of the source."""
    # Whatever is wrong with it, the command will say; a shell has no place for it.
    with suppress(Exception):
        from .reading import map_info

        source = parsed_args.source
        return [*map_info(source, parsed_args.topic, _index(parsed_args)).layers]
    return []


def complete_topics(parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    """Return the topics of maps in the source."""
    with suppress(Exception):
        from grid_map_ros_py import bag_topics

        return [topic.name for topic in bag_topics(parsed_args.source) if topic.holds_maps]
    return []


def complete_color_maps(**_: Any) -> list[str]:
    """Return the names of colour maps."""
    with suppress(Exception):
        from grid_map_visualization_py.colors import color_map_names

        return color_map_names()
    return []


def _index(options: argparse.Namespace) -> int:
    return -1 if options.index is None else int(options.index)
