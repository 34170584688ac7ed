# SPDX-License-Identifier: BSD-3-Clause
"""Command-line arguments shared by several commands, with shell completion."""

import argparse
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

_FORMAT = "name of the format, if the name of the file does not tell it"


def add_source(parser: argparse.ArgumentParser, which: str = "the last one") -> None:
    """Add the arguments for the source file and the options for reading.

    `which` describes the map of a bag that is read without `--index`, for the help text.
    """
    parser.add_argument("source", help="file or folder of any format, or - for .npz from a pipe")
    group = parser.add_argument_group("reading")
    name = group.add_argument("--from", dest="from_format", metavar="FORMAT", help=_FORMAT)
    completed(name, complete_formats)
    number = partial(group.add_argument, type=float)
    number("--resolution", help="clouds, meshes, height images: side of a cell [m]")
    number("--black", help="height images, read or written: height of black [m]")
    number("--white", help="height images, read or written: height of white [m]")
    number("--min-height", help="clouds: smallest height of points that are used [m]")
    number("--max-height", help="clouds: largest height of points that are used [m]")
    about = "name of the layer of heights (elevation)"
    group.add_argument("--height-layer", metavar="NAME", help=about)
    about = "clouds and meshes: read as (mesh if the file has faces)"
    group.add_argument("--as", dest="kind", choices=("points", "mesh"), help=about)
    reductions = ("max", "min", "mean", "median", "first", "last", "variance", "count")
    about = "clouds: reduction of the heights in a cell (max)"
    group.add_argument("--reduce", dest="reduction", choices=reductions, help=about)
    about = "clouds: center the map on the points, not on multiples of the resolution"
    group.add_argument("--tight", action="store_const", const=True, help=about)
    group = parser.add_argument_group("bags")
    topic = group.add_argument("--topic", help="topic of the maps, if the bag has several")
    completed(topic, complete_topics)
    group.add_argument(
        "--index", type=int, help=f"which map, 0 is the first, -1 the last ({which})"
    )
    about = "leave out damaged messages, and read a damaged MCAP file up to the last whole chunk"
    group.add_argument("--recover", action="store_const", const=True, help=about)
    group = parser.add_argument_group("limits for files")
    for limit, meaning in (
        ("cells", "largest number of cells of a map"),
        ("bytes", "largest size of all layers, or of unpacked data"),
        ("ratio", "largest quotient of unpacked and packed bytes, beyond 100 MB"),
    ):
        group.add_argument(f"--max-{limit}", type=float, metavar="NUMBER", help=meaning)


def add_layers(parser: argparse.ArgumentParser, text: str) -> None:
    action = parser.add_argument(
        "--layer", dest="layers", metavar="LAYER", action="append", help=f"{text}; may be repeated"
    )
    completed(action, complete_layers)


def add_destination(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "destination",
        help="name without ending (a bag), .npz, .tif, .zarr, .png, .rrd (Rerun), .yaml (nav2's "
        "map_server), or - for .npz to a pipe",
    )
    group = parser.add_argument_group("writing")
    about = "replace existing files"
    group.add_argument("-f", "--force", "--overwrite", action="store_true", help=about)
    name = group.add_argument("--to", metavar="FORMAT", help=_FORMAT)
    completed(name, partial(complete_formats, writes=True))
    about = "bags, npz, GeoTIFF: compress the file"
    group.add_argument("--compress", action="store_const", const=True, help=about)
    about = "height images: bits per pixel (16; 32 for .tif)"
    group.add_argument("--bits", type=int, choices=(8, 16, 32), help=about)
    about = "map_server: mode of the image (trinary)"
    group.add_argument("--mode", choices=("trinary", "scale", "raw"), help=about)
    about = "map_server: values of free and occupied cells, if the layer holds no occupancy values"
    group.add_argument("--data-min", type=float, metavar="VALUE", help=about)
    group.add_argument("--data-max", type=float, metavar="VALUE", help="see --data-min")
    about = "GeoTIFF, Zarr: reference system, such as EPSG:25832 (as in a GeoTIFF source)"
    group.add_argument("--crs", help=about)
    group.add_argument("--storage", choices=("mcap", "sqlite3"), help="bags: storage format")
    group.add_argument("--output-topic", metavar="TOPIC", help="bags: topic to write the maps to")


def add_json(parser: argparse.ArgumentParser, text: str = "print JSON") -> None:
    parser.add_argument("--json", action="store_true", help=text)


def completed(action: argparse.Action, completer: Callable[..., list[str]]) -> None:
    action.completer = completer  # type: ignore[attr-defined]


# If an error occurs, a completer returns nothing. The command itself then reports the error.


def complete_layers(parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    return [name for topic in _topics(parsed_args) for name in topic["map"]["layers"]]


def complete_topics(parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    parsed_args.topic = None
    return [topic["name"] for topic in _topics(parsed_args) if "name" in topic]


def _topics(parsed_args: argparse.Namespace) -> list[dict[str, Any]]:
    """Return the map topics of a bag, or the single map of another file."""
    with suppress(Exception):
        from ._maps import describe

        facts = describe(parsed_args)
        return [topic for topic in facts.get("topics", [facts]) if "map" in topic]
    return []


def complete_formats(*, writes: bool = False, **_: Any) -> list[str]:
    with suppress(Exception):
        from ..files._formats import formats

        return [one.name for one in formats().values() if (one.save if writes else one.load)]
    return []
