# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Executable `snapshot`: a picture of the next map of a topic, or of a map in a bag.

`snapshot --help` lists the options. The picture is written atomically. The exit code is 0
only if it was written.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.plugins import check
from grid_map_ros_py import ReceivedMap, load_from_bag
from grid_map_ros_py.errors import NodeFailedError
from grid_map_ros_py.nodes import MapSubscription, check_topic, run

from ..colors import DEFAULT_COLOR_MAP

DEFAULT_TOPIC = "/grid_map"
ONLY_FLAT, ONLY_THREE_D = ("shade_by",), ("color_layer", "max_cells")
"""Options that one kind of picture has alone."""
LONGEST_TIMEOUT = 1e9
"""A timer of ROS counts nanoseconds in 64 bits [s]."""


class SnapshotError(NodeFailedError):
    """The picture could not be taken."""


class SnapshotNode(Node):
    """Waits for a map, the last one that was published if there is one, and ends.

    Args:
        options: as `parsed` returns them.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__("grid_map_snapshot")
        self._options = options
        self._topic = check_topic(self, "--topic", options.topic or DEFAULT_TOPIC)
        is_time = 0 < options.timeout <= LONGEST_TIMEOUT
        expected = f"a positive time up to {LONGEST_TIMEOUT:g} s"
        check(is_time, "--timeout", expected, options.timeout)
        self._subscription = MapSubscription(self, self._topic, self._receive)
        self.create_timer(options.timeout, self._give_up)

    def _receive(self, received: ReceivedMap) -> None:
        if not self.context.ok():
            return
        try:
            write(received.decode(), self._options)
        except (GridMapError, OSError) as error:
            raise SnapshotError(f"{self._topic}: {error}") from error
        self.context.try_shutdown()

    def _give_up(self) -> None:
        raise SnapshotError(f"no map on {self._topic} within {self._options.timeout:g} s")


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the options of a command line; a wrong one ends the process with exit code 2."""
    parser = argparse.ArgumentParser(
        prog="snapshot", description="Write a picture of a grid map to a PNG file."
    )
    source = parser.add_argument_group("source")
    source.add_argument("--topic", help=f"of the maps ({DEFAULT_TOPIC}); in a bag, the only one")
    source.add_argument("--timeout", type=float, default=10.0, help="wait so long for a map [s]")
    source.add_argument("--bag", help="take the map from this bag instead")
    source.add_argument("--index", type=int, default=-1, help="which map of the bag (-1, the last)")
    picture = parser.add_argument_group("picture")
    picture.add_argument("--out", type=Path, default=Path("snapshot.png"), help="the file")
    picture.add_argument("--layer", default="elevation", help="what is shown; in 3-D the heights")
    picture.add_argument("--three-d", action="store_true", help="a shaded surface in 3-D")
    picture.add_argument("--color-layer", help="in 3-D: what gives the colors (the heights)")
    picture.add_argument("--max-cells", type=int, help="in 3-D: thin out larger maps; 0 for never")
    picture.add_argument("--shade-by", help="in 2-D: heights that the light falls on (no light)")
    picture.add_argument("--exaggeration", type=float, default=1.0, help="factor on the heights")
    colors = parser.add_argument_group("colors")
    modes = ("intensity", "color")
    colors.add_argument("--color-mode", choices=modes, default=modes[0], help="color: packed ones")
    colors.add_argument("--color-map", default=DEFAULT_COLOR_MAP, help="name in Matplotlib")
    colors.add_argument("--lower", type=float, help="value at the lower end (the smallest)")
    colors.add_argument("--upper", type=float, help="value at the upper end (the largest)")
    colors.add_argument("--invert", action="store_true", help="swap the ends of the color map")
    colors.add_argument("--label", default="", help="of the color bar (the name of the layer)")
    options = parser.parse_args(arguments)
    for name in ONLY_FLAT if options.three_d else ONLY_THREE_D:
        if getattr(options, name) is not None:
            kind = "without" if options.three_d else "with"
            parser.error(f"--{name.replace('_', '-')} goes {kind} --three-d only")
    return options


def write(grid_map: GridMap, options: argparse.Namespace) -> None:
    """Write the picture and tell where.

    Raises:
        GridMapError: the map lacks a layer, or an option is invalid.
        OSError: the file cannot be written.
    """
    # Matplotlib takes its time, which nobody has to wait for in vain.
    from ..pictures import save_picture

    title = f"{options.layer} in {grid_map.frame_id!r}"
    save_picture(grid_map, options.layer, options.out, title=title, **_style(options))
    print(options.out, flush=True)


def _style(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `save_picture` that were given."""
    names = (
        *("color_layer", "max_cells", "shade_by", "exaggeration"),
        *("color_mode", "color_map", "lower", "upper", "invert", "label"),
    )
    style = {name: getattr(options, name) for name in names}
    style["style"] = "surface" if options.three_d else "flat"
    return {name: value for name, value in style.items() if value is not None}


def _take_from_bag(options: argparse.Namespace) -> int:
    try:
        write(load_from_bag(options.bag, options.topic, index=options.index), options)
    except (GridMapError, OSError) as error:
        print(f"snapshot: {error}", file=sys.stderr)
        return 1
    return 0


def main() -> int:
    """Take the picture; return the exit code."""
    options = parsed(remove_ros_args(sys.argv)[1:])
    if options.bag is not None:
        return _take_from_bag(options)
    return run(lambda: SnapshotNode(options))


if __name__ == "__main__":
    sys.exit(main())
