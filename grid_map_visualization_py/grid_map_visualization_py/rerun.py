# SPDX-License-Identifier: BSD-3-Clause
"""Maps and bags in Rerun: in notebooks, in files, and in recordings of your own.

- `show` shows a map or a bag in a notebook.
- `recorded` writes a file (`.rrd`) map by map; `grid_map_core_py.save` writes one map.
- `Scene` writes maps and messages to any recording, `Style` says how, and `log_bag` takes them from
  a bag.
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
    """Show a map, or all messages of a bag, in Rerun in the output of a cell of a notebook.

    Args:
        source: the map, or the bag.
        style: how maps are drawn.
        width, height: size of the viewer [pixels].

    Raises:
        MissingPackageError: Rerun is not installed.
        GridMapError: the bag cannot be read.
    """
    # Otherwise the notebook loads the viewer from a server of Rerun.
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
