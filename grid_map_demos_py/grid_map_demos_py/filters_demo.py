# SPDX-License-Identifier: BSD-3-Clause
"""Demo of the traversability chain on real terrain, in four processes that communicate over DDS.

    filters_demo [--report DIRECTORY] [--view [PORT]]

Starts the terrain publisher, the filter chain and the visualization, and runs until it is
interrupted. With `--report`, a fourth process collects their messages, writes pictures into the
directory, prints a table and ends the demo; the exit code is 0 only if every topic delivered. With
`--view`, another process shows the filtered map in the browser and logs the address.
"""

from collections.abc import Sequence

from .processes import NodesDemo

NODES = {
    "grid_map_demos_py.terrain_publisher_node": "filters_demo.yaml",
    "grid_map_filters_py._executables.filter_chain": "filters_demo_filter_chain.yaml",
    "grid_map_visualization_py._executables.grid_map_visualization": (
        "filters_demo_visualization.yaml"
    ),
}
"""Parameter files in `config` by module."""

DEMO = NodesDemo(
    "filters_demo",
    __doc__.split("\n")[0],
    "grid_map_demos_py.demo_report_node",
    "filters_demo.yaml",
    "filters_demo_viewer.yaml",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo; return its exit code."""
    return DEMO.run(NODES, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
