# SPDX-License-Identifier: BSD-3-Clause
"""Show a map, or all messages of a bag, in the browser with Rerun."""

import argparse
import time
import webbrowser
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from grid_map_core_py._commands import (
    CommandError,
    UsageError,
    add_rectangle,
    add_source,
    complete_layers,
    completed,
    has_rectangle,
    message,
    on_end,
    read_map,
    read_rectangle,
    source_format,
    tiled_source,
)
from grid_map_core_py.limits import current_limits

from .plot import complete_color_maps, usual_layer

if TYPE_CHECKING:
    from grid_map_core_py import GridMap
    from grid_map_core_py.tiled import TiledMap

_SIDE = 1000
"""Maximum number of rows and of columns to show if a map is too large for memory."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_source(parser, "all, with the other messages of the bag")
    add_rectangle(parser)
    add = parser.add_argument
    text = "height layer (elevation, or the first layer)"
    completed(add("--layer", default="", help=text), complete_layers)
    text = "initial color layer (the height layer)"
    completed(add("--color-layer", default="", help=text), complete_layers)
    text = "Matplotlib color map of the color layer (%(default)s)"
    completed(add("--color-map", default="viridis", help=text), complete_color_maps)
    add("--lower", type=float, help="value at the lower end of the colors (the smallest)")
    add("--upper", type=float, help="value at the upper end of the colors (the largest)")
    text = "factor that scales the heights (%(default)s)"
    add("--exaggeration", type=float, default=1.0, help=text)
    text = "maximum cell count of a surface; larger maps are downsampled; 0 for no limit"
    add("--max-drawn-cells", type=int, default=150_000, help=text)
    page = parser.add_argument_group("page")
    text = "address to serve at (%(default)s: this machine only)"
    page.add_argument("--host", default="127.0.0.1", help=text)
    text = "port of the page (%(default)s); 0 selects a free port"
    page.add_argument("--port", type=int, default=9876, help=text)
    text = "additional host name under which browsers may open the page; may be repeated"
    page.add_argument("--allowed-hosts", metavar="NAME", action="append", default=[], help=text)
    text = "maximum amount of shown data [MB]; the rest of a bag is left out (%(default)s)"
    page.add_argument("--most-shown", type=int, metavar="MB", default=1000, help=text)
    page.add_argument("--open", action="store_true", help="also open a browser")


def run(options: argparse.Namespace) -> int:
    from .._rerun.recording import log_bag
    from .._rerun.scene import Scene, Style
    from .._rerun.server import Server

    if options.most_shown < 1:
        raise UsageError(f"--most-shown: expected a positive number, got {options.most_shown}")
    style = Style(
        height_layer=options.layer,
        color_layer=options.color_layer,
        color_map=options.color_map,
        lower=options.lower,
        upper=options.upper,
        exaggeration=options.exaggeration,
        max_drawn_cells=options.max_drawn_cells,
    )
    came: list[int] = []
    on_end(lambda number, _: came.append(number))
    grid_map = None if _is_whole_bag(options) else _read(options)
    # The indexes of Rerun need up to a quarter more memory.
    limit = f"{options.most_shown + options.most_shown // 4 + 100}MB"
    where = {"allowed_hosts": options.allowed_hosts, "memory_limit": limit}
    with closing(Server(options.host, options.port, **where)) as server:
        if server.is_public:
            message(f"warning: anyone who can reach {server.page_url} sees the map")
        scene = Scene(server.recording, style)
        print(server.page_url, flush=True)
        if options.open:
            webbrowser.open(server.page_url)
        if grid_map is None:
            most = 1_000_000 * options.most_shown

            def goes_on(time: int) -> bool:
                scene.send_layout()
                if scene.size <= most:
                    return not came and not server.problem
                megabytes = f"{options.most_shown} MB are full (--most-shown)"
                message(f"messages after {time / 1e9:.3f} s are left out: {megabytes}")
                return False

            which = {"topic": options.topic, "recover": bool(options.recover)}
            log_bag(scene, options.source, **which, goes_on=goes_on)
            wanted = [repr(one) for one in (options.layer, options.color_layer) if one]
            if wanted and not scene.surfaces:
                names = " and ".join(wanted)
                message(f"warning: no map has the layer {names}, so there is no surface")
        else:
            scene.log_map(Path(options.source).stem, grid_map)
            scene.send_layout()
        server.recording.flush()
        while not came and not server.problem:
            time.sleep(0.05)
        if server.problem:
            raise CommandError(server.problem)
    return 0


def _is_whole_bag(options: argparse.Namespace) -> bool:
    """Return whether to show all messages of a bag; raise an error if none can be shown."""
    if source_format(options) != "bag" or options.index is not None:
        return False
    if has_rectangle(options):
        raise UsageError("a rectangle needs one map of the bag: select it with --index")
    from grid_map_ros_py import bag_topics

    from .._rerun.scene import SHOWN_TYPES

    topics = [one for one in bag_topics(options.source, recover=bool(options.recover)) if one.count]
    others = [f"{one.name} ({one.type})" for one in topics if one.type not in SHOWN_TYPES]
    if len(others) == len(topics):
        raise CommandError(f"{options.source}: expected messages that are shown, got {others}")
    if options.topic and options.topic not in [one.name for one in topics]:
        names = ", ".join(one.name for one in topics)
        raise CommandError(f"{options.source}: no topic {options.topic!r}; topics: {names}")
    if others:
        message(f"not shown: {', '.join(others)}")
    return True


def _read(options: argparse.Namespace) -> "GridMap":
    """Read the map or the requested rectangle, and check that the requested layers exist."""
    if has_rectangle(options):
        grid_map = read_rectangle(options)
    else:
        tiled_map = tiled_source(options)
        grid_map = read_map(options) if tiled_map is None else _thinned(tiled_map, options)
    for name in (options.layer or usual_layer(grid_map), options.color_layer):
        if name:
            grid_map[name]  # raises if the layer does not exist
    return grid_map


def _thinned(tiled_map: "TiledMap", options: argparse.Namespace) -> "GridMap":
    """Return every n-th row and column of a map that is too large for memory."""
    layers = {options.layer or usual_layer(tiled_map), options.color_layer} - {""}
    rows, columns = tiled_map.size
    step = -(-max(rows, columns) // _SIDE)
    while -(-rows // step) * -(-columns // step) > current_limits().max_cells:
        step += 1
    grid_map = tiled_map.thinned(step, layers)
    step = round(grid_map.resolution / tiled_map.resolution)
    message(f"one of {step} x {step} cells is shown; --position and --length show a part")
    return grid_map
