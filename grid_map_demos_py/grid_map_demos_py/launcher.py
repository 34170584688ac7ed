# SPDX-License-Identifier: BSD-3-Clause
"""Demos that start several nodes without launch files.

    filters_demo, elevation_mapping_demo, large_map_demo, path_planner_demo, planar_regions_demo
        [--report DIRECTORY] [--view [PORT]]

Each node runs in its own process. If the demo is interrupted or a node ends, all nodes are stopped.

- `--report`: a further process writes pictures, prints a table and ends the demo. The exit code is
  0 only if messages arrive on all topics.
- `--view`: a further process shows the demo in the browser and logs the address.
"""

import argparse
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import takewhile
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType

from grid_map_core_py._commands import die_with_parent, on_end
from grid_map_core_py.errors import GridMapError

VIEWERS = {
    "rerun_cli": "grid_map_visualization_py._executables.rerun_viewer",
    "viser": "grid_map_visualization_py._executables.web_viewer",
}
"""Viewer modules by required library, in order of preference."""

PATIENCE = 5.0  # time after which processes that have not stopped are killed [s]

WINDOW = "grid_map_ros_py._executables.grid_map_window"


@dataclass(frozen=True)
class NodesDemo:
    """Demo that starts nodes and, on request, a report or a browser viewer.

    The folder `config` contains the parameters of the report in `NAME.yaml`, and those of the
    viewers in `NAME_viewer.yaml`.

    Attributes:
        name: name of the executable.
        about: one-sentence description for `--help`.
        report: name of the report in `report_node`.
        nodes: names of the parameter files in `config`, by node module.
    """

    name: str
    about: str
    report: str
    nodes: Mapping[str, str]

    def __call__(
        self,
        arguments: Sequence[str] | None = None,
        *,
        steps: Iterable[object] = (),
        parameters: Mapping[str, str] | None = None,
    ) -> int:
        """Run the demo and return its exit code.

        Args:
            arguments: command-line arguments; None means `sys.argv[1:]`.
            steps: iterable that prepares the demo; an interrupt skips the remaining steps.
            parameters: one additional parameter `name:=value` per node, by node module.
        """
        parser = argparse.ArgumentParser(prog=self.name, description=self.about)
        about = "write pictures there, print a table and end"
        parser.add_argument("--report", metavar="DIRECTORY", help=about)
        about = "show the demo in the browser, at http://127.0.0.1:8080 or another port"
        parser.add_argument("--view", metavar="PORT", nargs="?", type=int, const=8080, help=about)
        words = sys.argv[1:] if arguments is None else arguments
        # `ros2 launch` and `ros2 run` may append arguments that are meant for ROS.
        options = parser.parse_args(list(takewhile(lambda word: word != "--ros-args", words)))
        with ProcessGroup() as processes:
            for _ in takewhile(lambda _: not processes.stopped, steps):
                pass
            for module, file in self.nodes.items():
                given = (parameters or {}).get(module)
                processes.start([module], file, *([given] if given else []))
            if options.view is not None:
                viewer_file = f"{self.name}_viewer.yaml"
                processes.start([viewer()], viewer_file, f"port:={options.view}")
            report = ["grid_map_demos_py.report_node", self.report]
            if options.report:
                folder = f"output_directory:={options.report}"
                processes.start(report, f"{self.name}.yaml", folder)
            ended = processes.wait()
        if ended is None:
            return 1 if options.report else 0
        module, code = ended
        if module == report[0]:
            return code
        print(f"{self.name}: {module} ended with exit code {code}", file=sys.stderr)
        return code or 1


filters_demo = NodesDemo(
    "filters_demo",
    "Demo of the traversability chain on real terrain, in processes that communicate over DDS.",
    "filters",
    {
        "grid_map_demos_py.terrain_publisher_node": "filters_demo.yaml",
        "grid_map_filters_py._executables.filter_chain": "filters_demo_filter_chain.yaml",
        "grid_map_visualization_py._executables.grid_map_visualization": (
            "filters_demo_visualization.yaml"
        ),
    },
)

elevation_mapping_demo = NodesDemo(
    "elevation_mapping_demo",
    "Demo of elevation mapping with a simulated robot, in processes that communicate over DDS.",
    "elevation_mapping",
    {
        "grid_map_demos_py.elevation_mapping_robot_node": "elevation_mapping_demo.yaml",
        "grid_map_ros_py._executables.elevation_mapping": "elevation_mapping_demo_mapping.yaml",
    },
)

path_planner_demo = NodesDemo(
    "path_planner_demo",
    "Demo of a simulated robot that maps the ground, plans a path and walks to a goal.",
    "path_planner",
    {
        "grid_map_ros_py._executables.path_planner": "path_planner_demo_planner.yaml",
        "grid_map_ros_py._executables.elevation_mapping": "path_planner_demo_mapping.yaml",
        "grid_map_demos_py.path_planner_robot_node": "path_planner_demo.yaml",
    },
)

planar_regions_demo = NodesDemo(
    "planar_regions_demo",
    "Demo of the planar regions of stairs, a ramp and stepping stones that a camera sees.",
    "planar_regions",
    {
        "grid_map_ros_py._executables.planar_regions": "planar_regions_demo_regions.yaml",
        "grid_map_ros_py._executables.elevation_mapping": "planar_regions_demo_mapping.yaml",
        "grid_map_demos_py.planar_regions_robot_node": "planar_regions_demo.yaml",
    },
)


def large_map_demo(arguments: Sequence[str] | None = None) -> int:
    """Write a large map to a temporary folder and run a demo that publishes windows of it."""
    from .large_site import GEOMETRY, make_site

    demo = NodesDemo(
        "large_map_demo",
        "Demo of a map of 10^9 cells on disk, of which a robot gets the window around it.",
        "large_map",
        {
            WINDOW: "large_map_demo_window.yaml",
            "grid_map_demos_py.large_map_robot_node": "large_map_demo.yaml",
        },
    )

    def make(path: Path) -> Iterator[None]:
        begin = time.monotonic()
        yield from make_site(path)
        size = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
        text = f"{GEOMETRY.size[0]} x {GEOMETRY.size[1]} cells into {size / 1e6:.0f} MB on disk"
        print(f"wrote {text} in {time.monotonic() - begin:.0f} s", flush=True)

    with TemporaryDirectory(prefix="large_map_demo-") as folder:
        path = Path(folder, "site.zarr")
        try:
            return demo(arguments, steps=make(path), parameters={WINDOW: f"source:={path}"})
        except GridMapError as error:
            print(f"large_map_demo: {error}", file=sys.stderr)
            return 1


def viewer() -> str:
    """Return the first viewer module whose library is installed; the last one if none is."""
    return next((VIEWERS[name] for name in VIEWERS if find_spec(name)), [*VIEWERS.values()][-1])


class ProcessGroup:
    """Starts Python modules as processes, and stops all processes on exit.

    SIGINT (Ctrl-C), SIGTERM and SIGHUP set `stopped`, which ends `wait`.
    """

    def __init__(self) -> None:
        self.stopped = False
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> "ProcessGroup":
        def stop(_number: int, _frame: FrameType | None) -> None:
            self.stopped = True

        on_end(stop)
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            # Unlike SIGINT, SIGTERM causes no traceback while Python is still starting.
            process.terminate()
        deadline = time.monotonic() + PATIENCE
        for process in self._processes.values():
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        # Ignore late signals: Python removes its own signal handlers at exit.
        on_end(signal.SIG_IGN)

    def start(self, module: Sequence[str], parameter_file: str, *parameters: str) -> None:
        """Start a node with a parameter file in `config` and parameters `name:=value`."""
        from ament_index_python.packages import get_package_share_directory

        if not self.stopped:
            folder = Path(get_package_share_directory("grid_map_demos_py"), "config")
            file = str(folder / parameter_file)
            given = [word for parameter in parameters for word in ("-p", parameter)]
            command = [sys.executable, "-m", *module, "--ros-args", "--params-file", file, *given]
            self._processes[module[0]] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                start_new_session=True,  # so that Ctrl-C in the terminal does not reach it
                preexec_fn=die_with_parent(signal.SIGTERM),
            )

    def wait(self) -> tuple[str, int] | None:
        """Wait until a process ends; return its module and exit code, or None after a signal."""
        while not self.stopped:
            for module, process in self._processes.items():
                code = process.poll()
                if code is not None:
                    return module, code
            time.sleep(0.05)
        return None


if __name__ == "__main__":
    raise SystemExit(globals()[sys.argv[1]](sys.argv[2:]))
