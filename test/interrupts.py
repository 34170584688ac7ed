# SPDX-License-Identifier: BSD-3-Clause
"""Signals at random moments to every executable, while messages arrive.

`python3 test/interrupts.py --count 2000` starts the executables. Each gets SIGINT, SIGTERM or
SIGHUP, sometimes twice, and must end in time with the right exit code, without a child or a damaged
file, and after one signal without a traceback. A failure is printed with the number of its trial;
`--only` repeats trials.
"""

import argparse
import importlib
import itertools
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from grid_map_core_py import GridMap, load, save
from grid_map_core_py._commands import on_end
from grid_map_core_py.tiled import TiledMap
from grid_map_ros_py import BagReader, save_to_bag
from grid_map_ros_py.testing import Peer, Process, peer, wait_until

ROOT = Path(__file__).resolve().parent.parent
CONFIG = ROOT / "grid_map_demos_py" / "config"
CHAIN = CONFIG / "filters_demo_filter_chain.yaml"
LARGE_MAPS = ROOT / "grid_map_ros_py" / "grid_map_ros_py" / "fastdds_large_maps.xml"
OUTPUTS = ROOT / "grid_map_visualization_py" / "config" / "grid_map_visualization.yaml"
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

PATIENCE = 20.0
"""Longest time from the last signal to the end, on a busy machine [s]."""

BAD = re.compile("Traceback|Exception|terminate called|Fatal|core dumped")


class Executable(NamedTuple):
    """An executable and how it is tried.

    Attributes:
        path: the file.
        arguments: its arguments; {folder} stands for a folder of the trial, {data} for maps.
        codes: exit codes once it handles signals; none for those of a signal.
    """

    path: Path
    arguments: str = ""
    codes: tuple[int, ...] = (0,)

    @property
    def name(self) -> str:
        """Name of the executable and of its command."""
        return " ".join([self.path.name, *self.arguments.split()[: self.is_command]])

    @property
    def is_command(self) -> bool:
        """True for `grid-map`, which handles signals before it knows its command."""
        return self.path.name in ("grid-map", "grid_map")


ARGUMENTS = {
    "elevation_mapping_report": "-p output_directory:={folder} -p duration:=1000.0",
    "demo_report": "-p output_directory:={folder} -p messages:=100000",
    "elevation_mapping": "-p pose_source:=none -p map_frame_id:=map -p directory:={folder} "
    "-p length_in_x:=20.0 -p length_in_y:=20.0 -p resolution:=0.1",
    "filter_chain": f"--params-file {CHAIN}",
    "grid_map_loader": "-p file_path:={data}/bag",
    "grid_map_saver": "-p file_path:={folder}/bag -p continuous:=true",
    "grid_map_window": "-p source:={data}/site.zarr -p pose_source:=odometry -p write_back:=true "
    "-p write_topic:=/grid_map -p output_topic:=/window -p step:=0.0",
    "large_map_report": "-p output_directory:={folder} -p duration:=1000.0",
    "path_planner": "-p cost_layer:=''",
    "path_planner_report": "-p output_directory:={folder} -p timeout:=1000.0",
    "planar_regions_report": "-p output_directory:={folder} -p timeout:=1000.0",
    "grid_map_server": "-p directory:={folder} -p input_topic:=/grid_map -p output_topic:=/served",
    # The contours of noise take long, and it has no normals.
    "grid_map_visualization": f"--params-file {OUTPUTS} -p grid_map_visualizations:="
    "[elevation_surface,elevation_image,elevation_points,elevation_grid,map_region]",
    "point_cloud_to_grid_map": "-p pose_source:=none -p map_frame:=map -p robot_centric:=false",
    "rerun_viewer": "-p port:=0",
    "web_viewer": "-p port:=0",
}
"""Parameters of nodes that need some, or would take nothing without them."""

COMMANDS = {
    "convert {data}/map.npz {folder}/new.npz --compress": (),
    f"filter {CHAIN} {{data}}/map.npz {{folder}}/new.npz": (),
    "plot {data}/map.npz {folder}/new.png": (),
    "play {data}/bag --loop": (0,),
    "record /grid_map {folder}/bag": (0, 1),  # 1: no map has come
    "topics --wait 100": (0,),
    "view {data}/map.npz --port 0": (0,),
}


def executables() -> list[Executable]:
    """Return all executables of the workspace."""
    (program,) = ROOT.glob("install/*/bin/grid-map")
    files = (path for path in sorted(ROOT.glob("install/*/lib/grid_map_*/*")) if path.is_file())
    nodes = [Executable(path, f"--ros-args {ARGUMENTS.get(path.name, '')}") for path in files]
    known = {node.path.name: node for node in nodes}
    known["snapshot"] = known["snapshot"]._replace(arguments="--topic /silent --timeout 100")
    for name in ("octomap_to_grid_map", "octomap_to_gridmap_demo"):
        known[name] = known[name]._replace(codes=(0, 1))  # 1: there is no octomap_msgs
    # 1: the map of a demo beside it has no elevation
    known["grid_map_to_image_demo"] = known["grid_map_to_image_demo"]._replace(codes=(0, 1))
    known["iterator_benchmark"] = known["iterator_benchmark"]._replace(arguments="", codes=())
    known["grid_map"] = known["grid_map"]._replace(arguments="inspect {data}/map.npz", codes=())
    return [*known.values(), *(Executable(program, *command) for command in COMMANDS.items())]


class Trial(NamedTuple):
    """An executable, and which signals it gets.

    Attributes:
        is_up: whether the times count from the moment when it handles signals, not from its start.
        times: when it gets the signals [s].
    """

    number: int
    executable: Executable
    to_group: bool
    kind: signal.Signals
    is_up: bool
    times: list[float]

    def __str__(self) -> str:
        times = " and ".join(f"{when:.3f} s" for when in self.times)
        begin = " once it runs" if self.is_up else ""
        signals = f"{self.kind.name} to {'group' if self.to_group else 'process'}"
        return f"trial {self.number}: {self.executable.name}, {signals} at {times}{begin}"


def trials(seed: int) -> Iterator[Trial]:
    """Yield trials without end; each round tries all executables."""
    known = executables()
    for number in itertools.count():
        chance = random.Random(f"{seed} {number}")
        order = random.Random(f"{seed} {number // len(known)}").sample(known, len(known))
        when = chance.uniform(0, 2)
        times = [when, when + chance.uniform(0, 0.3)][: chance.choice([1, 1, 2])]
        to_group, kind, is_up = chance.random() < 0.5, chance.choice(SIGNALS), chance.random() < 0.5
        yield Trial(number, order[number % len(known)], to_group, kind, is_up, times)


def carry_out(trial: Trial, data: str) -> tuple[str, str]:
    """Start an executable and interrupt it; return how far it was, and what is wrong."""
    with tempfile.TemporaryDirectory(prefix="interrupts-") as folder:
        words = trial.executable.arguments.format(folder=folder, data=data).split()
        environ = {"TMPDIR": folder, "HOME": folder, "XDG_CACHE_HOME": str(Path.home() / ".cache")}
        process = Process([str(trial.executable.path), *words], environ)
        try:
            phase = interrupt(trial, process)
            return phase, fault(trial, process, phase, Path(folder))
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def interrupt(trial: Trial, process: Process) -> str:
    """Send the signals of a trial, and return how far the process was; "" if it had ended."""
    if trial.is_up:
        wait_until(
            lambda: not process.is_running or phase_of(process.pid) == "runs",
            "handlers of signals",
            timeout=10 * PATIENCE,
        )
    begin, phase = time.monotonic(), ""
    for when in trial.times:
        with suppress(subprocess.TimeoutExpired):
            subprocess.Popen.wait(process, max(0.0, begin + when - time.monotonic()))
        if process.is_running:
            phase = phase or phase_of(process.pid)
            (os.killpg if trial.to_group else os.kill)(process.pid, trial.kind)
    return phase


def phase_of(pid: int) -> str:
    """Return how far a process has come: "starts" until it handles SIGTERM, then "runs"."""
    with suppress(OSError):
        status = Path(f"/proc/{pid}/status").read_text()
        caught = int(status.partition("SigCgt:")[2].split()[0], 16)
        return "runs" if caught >> (signal.SIGTERM - 1) & 1 else "starts"
    return "ends"


def fault(trial: Trial, process: Process, phase: str, folder: Path) -> str:
    """Return what is wrong with the end of a process; "" if all is right."""
    try:
        code = process.wait(10 * PATIENCE)
    except subprocess.TimeoutExpired:
        return f"hangs\n{listed(process)}\n{process.text}"
    codes = trial.executable.codes
    right = {-trial.kind, 128 + trial.kind}
    if not phase:
        right = {0, *codes}
    elif phase == "ends":
        # It had ended by itself a moment before.
        right |= {0, *codes}
    elif codes:
        is_certain = phase == "runs" and not trial.executable.is_command
        right = {*codes, *(() if is_certain else right)}
    # Python prints a second signal that it cannot raise, as in a finalizer.
    if code not in right or (len(trial.times) == 1 and BAD.search(process.text)):
        return f"exit code {code}, expected one of {sorted(right)}\n{process.text}"
    try:
        wait_until(lambda: not listed(process), "the end of children", timeout=PATIENCE)
    except AssertionError:
        return f"leaves a process\n{listed(process)}"
    return damage(folder)


def damage(folder: Path) -> str:
    """Return which file is left over; raise an error if one is damaged."""
    for path in folder.iterdir():
        if path.name == "bag":
            with BagReader(path) as bag:
                bag[-1].grid_map()
        elif path.suffix == ".npz":
            load(path)
        elif path.suffix != ".png" and not path.name.startswith("."):
            return f"leaves {path.name}"
    return ""


def listed(process: Process) -> str:
    """Return the processes of the group, as `ps` lists them."""
    columns = "pid,ppid,pgid,stat,wchan:20,etime,args"
    text = subprocess.run(["ps", "-eo", columns], capture_output=True, text=True).stdout
    lines = (line for line in text.splitlines() if line.split()[2] == str(process.pid))
    return "\n".join(line for line in lines if "<defunct>" not in line)


def noisy_map() -> GridMap:
    """Return a map of 403 x 344 cells."""
    grid_map = GridMap((40.3, 34.4), 0.1, frame_id="map", timestamp=10**9)
    grid_map["elevation"] = np.random.default_rng(1).random(grid_map.size)
    return grid_map


def disturb() -> None:
    """Publish at 30 Hz, and take what nodes publish.

    Ends after a signal, or with the process that started it.
    """
    from nav_msgs.msg import Odometry

    from grid_map_ros_py import to_image, to_message, to_point_cloud
    from grid_map_ros_py.messages import serialize
    from grid_map_ros_py.nodes import map_qos

    grid_map, ended = noisy_map(), []
    odometry = Odometry()
    odometry.header.frame_id, odometry.pose.pose.orientation.w = "map", 1.0
    messages = {
        "/odom": odometry,
        "/grid_map": to_message(grid_map),
        "/image": to_image(grid_map, "elevation", "mono16"),
        "/points": to_point_cloud(grid_map, "elevation"),
    }
    on_end(lambda *_: ended.append(True))
    starter = os.getppid()
    # The domain of the process that started this one, which a peer would avoid.
    with peer(int(os.environ["ROS_DOMAIN_ID"])) as other:
        sources = [
            (other.node.create_publisher(type(message), topic, map_qos()), serialize(message))
            for topic, message in messages.items()
        ]
        taken = {*messages, "/rosout"}
        print("publishes", flush=True)
        while not ended and os.getppid() == starter:
            for publisher, data in sources:
                if publisher.get_subscription_count():
                    publisher.publish(data)
            listen(other, taken)
            other.spin(1 / 30)


def listen(other: Peer, taken: set[str]) -> None:
    """Subscribe to all topics that are not in `taken`, and add them to it."""
    for topic, (kind, *_) in other.node.get_topic_names_and_types():
        if topic not in taken:
            taken.add(topic)
            package, *_, name = kind.split("/")
            message_type = getattr(importlib.import_module(f"{package}.msg"), name)
            other.node.create_subscription(message_type, topic, lambda _: None, 1, raw=True)


@contextmanager
def disturbed() -> Iterator[str]:
    """Run `disturb` as a process; yield the folder of a map and a bag."""
    with tempfile.TemporaryDirectory() as data:
        save(noisy_map(), Path(data, "map.npz"), compress=True)
        save_to_bag(noisy_map(), Path(data, "bag"), "/grid_map")
        TiledMap.create(Path(data, "site.zarr"), noisy_map().geometry, ["elevation"])
        # With the memory of the profile for tests most clouds would get lost.
        profile = {"FASTRTPS_DEFAULT_PROFILES_FILE": str(LARGE_MAPS)}
        process = Process([sys.executable, __file__, "--disturb"], profile)
        try:
            wait_until(lambda: process.lines, "the publisher of maps")
            yield data
            assert process.is_running, process.text
        finally:
            process.stop()


def outcomes(wanted: Iterable[Trial], jobs: int) -> Iterator[tuple[Trial, str, str]]:
    """Carry out trials, `jobs` at a time; yield each with its phase and its fault."""
    with disturbed() as data, ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(lambda trial: (trial, *carry_out(trial, data)), wanted)


def main() -> int:
    """Carry out trials; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=100, help="number of trials (%(default)s)")
    parser.add_argument("--seed", type=int, default=time.time_ns() % 10**6)
    parser.add_argument("--jobs", type=int, default=4, help="trials at a time (%(default)s)")
    parser.add_argument("--only", type=int, nargs="+", help="numbers of trials")
    parser.add_argument("--disturb", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.disturb:
        disturb()
        return 0
    # In the background of a script SIGINT is ignored, and so it would be in the children. Each of
    # these signals lets trials end that run, and kills what they have started.
    for number in SIGNALS:
        signal.signal(number, signal.default_int_handler)
    print(f"seed {options.seed}", flush=True)
    wanted = itertools.islice(trials(options.seed), options.count)
    wanted = [trial for trial in wanted if not options.only or trial.number in options.only]
    counts: Counter[tuple[str, str]] = Counter()
    failures = 0
    for trial, phase, text in outcomes(wanted, options.jobs):
        counts[trial.executable.name, phase or "ended before"] += 1
        if text:
            failures += 1
            print(f"{trial}, {phase}: {text}", flush=True)
    for (name, phase), count in sorted(counts.items()):
        print(f"{name:32} {phase:16} {count:5}")
    print(f"{sum(counts.values())} trials, {failures} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
