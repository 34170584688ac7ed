# SPDX-License-Identifier: BSD-3-Clause
"""Demo of a map of 10^9 cells on disk, of which a robot gets the window around it.

    large_map_demo [--report DIRECTORY] [--view [PORT]]

Writes the map into a temporary folder, starts a simulated robot and the node `grid_map_window`, and
runs until it is interrupted. With `--report`, another process measures how the windows arrive,
writes pictures into the directory, prints a table and ends the demo. With `--view`, another process
shows the windows in the browser and logs the address.
"""

import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from grid_map_core_py.errors import GridMapError

from .large_site import GEOMETRY, make_site
from .processes import NodesDemo

WINDOW = "grid_map_ros_py._executables.grid_map_window"

NODES = {
    WINDOW: "large_map_demo_window.yaml",
    "grid_map_demos_py.large_map_robot_node": "large_map_demo.yaml",
}
"""Parameter files in `config` by module."""

DEMO = NodesDemo(
    "large_map_demo",
    __doc__.split("\n")[0],
    "grid_map_demos_py.large_map_report_node",
    "large_map_demo.yaml",
    "large_map_demo_viewer.yaml",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo; return its exit code."""
    with TemporaryDirectory(prefix="large_map_demo-") as folder:
        path = Path(folder, "site.zarr")
        try:
            return DEMO.run(
                NODES, arguments, steps=_make(path), parameters={WINDOW: f"source:={path}"}
            )
        except GridMapError as error:
            print(f"large_map_demo: {error}", file=sys.stderr)
            return 1


def _make(path: Path) -> Iterator[None]:
    begin = time.monotonic()
    yield from make_site(path)
    size = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    rows, columns = GEOMETRY.size
    text = f"{rows} x {columns} cells into {size / 1e6:.0f} MB on disk"
    print(f"wrote {text} in {time.monotonic() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
