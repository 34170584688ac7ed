# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Demo of the traversability chain on real terrain, in four processes that communicate over DDS.

    filters_demo [--report DIRECTORY] [--view [PORT]]

Starts the terrain publisher, the filter chain and the visualization, and runs until it is
interrupted. With `--report`, a fourth process collects their messages, writes pictures into the
directory, prints a table and ends the demo; the exit code is 0 only if every topic delivered. With
`--view`, another process shows the filtered map in the browser and logs the address.
"""

import argparse
import sys
from collections.abc import Sequence
from itertools import takewhile

from .processes import ProcessGroup

REPORT = "grid_map_demos_py.demo_report_node"

VIEWER = "grid_map_visualization_py._executables.web_viewer"
VISUALIZATION = "grid_map_visualization_py._executables.grid_map_visualization"

NODES = {
    "grid_map_demos_py.terrain_publisher_node": "filters_demo.yaml",
    "grid_map_filters_py._executables.filter_chain": "filters_demo_filter_chain.yaml",
    VISUALIZATION: "filters_demo_visualization.yaml",
}
"""Parameter files in `config` by module."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo; return its exit code."""
    with ProcessGroup() as processes:
        options = _parse(arguments)
        for module, parameters in NODES.items():
            processes.start(module, _ros_arguments(parameters))
        if options.view is not None:
            port = ["-p", f"port:={options.view}"]
            processes.start(VIEWER, [*_ros_arguments("filters_demo_viewer.yaml"), *port])
        if options.report:
            output = ["-p", f"output_directory:={options.report}"]
            processes.start(REPORT, [*_ros_arguments("filters_demo.yaml"), *output])
        return _exit_code(processes.wait(), interrupted=1 if options.report else 0)


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="filters_demo", description=__doc__.split("\n")[0])
    about = "write pictures there, print a table and end"
    parser.add_argument("--report", metavar="DIRECTORY", help=about)
    about = "show the filtered map in the browser, at http://127.0.0.1:8080 or another port"
    parser.add_argument("--view", metavar="PORT", nargs="?", type=int, const=8080, help=about)
    words = sys.argv[1:] if arguments is None else arguments
    # `ros2 launch` and `ros2 run` may append arguments that are meant for ROS.
    return parser.parse_args(list(takewhile(lambda word: word != "--ros-args", words)))


def _ros_arguments(parameter_file: str) -> list[str]:
    from .share import share

    return ["--ros-args", "--params-file", str(share("config", parameter_file))]


def _exit_code(ended: tuple[str, int] | None, interrupted: int) -> int:
    if ended is None:
        return interrupted
    module, code = ended
    if module != REPORT:
        print(f"filters_demo: {module} ended with exit code {code}", file=sys.stderr)
        return code or 1
    return code


if __name__ == "__main__":
    raise SystemExit(main())
