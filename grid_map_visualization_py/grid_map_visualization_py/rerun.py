# SPDX-License-Identifier: BSD-3-Clause
"""Show maps and bags in a notebook with Rerun, or write them to Rerun recordings.

- `show` shows a map or a bag in a notebook.
- `recorded` opens a file (`.rrd`) for any number of maps; `grid_map_core_py.save` writes one map.
- `Scene` writes maps and messages to any recording, with a `Style` of your choice.
- `log_bag` writes the messages of a bag to a scene.
"""

import os
from os import PathLike

from grid_map_core_py import GridMap

from ._rerun.recording import log_bag, recorded
from ._rerun.scene import Scene, Style, rerun

__all__ = ["Scene", "Style", "log_bag", "recorded", "show"]


def show(
    source: GridMap | str | PathLike[str],
    style: Style | None = None,
    *,
    width: int | None = None,
    height: int | None = None,
) -> None:
    """Show a map, or all messages of a bag, in a Rerun viewer below a notebook cell.

    Args:
        source: a map, or the path of a bag.
        style: style of the maps.
        width, height: size of the viewer [pixels].

    Raises:
        MissingPackageError: Rerun is not installed.
        GridMapError: the bag cannot be read.
    """
    # By default, the notebook would load the viewer from rerun.io.
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "serve-local")
    rr = rerun()
    recording = rr.RecordingStream("grid_map")
    viewer = rerun("rerun.notebook").Viewer(width=width, height=height, recording=recording)
    scene = Scene(recording, style)
    if isinstance(source, GridMap):
        scene.log_map("grid_map", source)
    else:
        log_bag(scene, source)
    scene.send_layout()
    viewer.display()
