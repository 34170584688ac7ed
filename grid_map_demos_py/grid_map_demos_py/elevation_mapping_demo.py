# SPDX-License-Identifier: BSD-3-Clause
"""Demo of elevation mapping with a simulated robot, in processes that communicate over DDS.

    elevation_mapping_demo [--report DIRECTORY] [--view [PORT]]

Starts the simulated robot and the node `elevation_mapping`, whose chain of filters computes the
traversability, and runs until it is interrupted. With `--report`, another process compares the map
with the true terrain, writes pictures into the directory, prints a table and ends the demo. With
`--view`, another process shows the map in the browser and logs the address.
"""

from collections.abc import Sequence

from .processes import NodesDemo

NODES = {
    "grid_map_demos_py.elevation_mapping_robot_node": "elevation_mapping_demo.yaml",
    "grid_map_ros_py._executables.elevation_mapping": "elevation_mapping_demo_mapping.yaml",
}
"""Parameter files in `config` by module."""

DEMO = NodesDemo(
    "elevation_mapping_demo",
    __doc__.split("\n")[0],
    "grid_map_demos_py.elevation_mapping_report_node",
    "elevation_mapping_demo.yaml",
    "elevation_mapping_demo_viewer.yaml",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo; return its exit code."""
    return DEMO.run(NODES, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
