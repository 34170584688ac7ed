# SPDX-License-Identifier: BSD-3-Clause
"""Fuzzing of all readers: damaged input must raise `GridMapError` quickly, in little memory.

    python3 test/fuzz.py --seconds 60
    python3 test/fuzz.py --inputs 1000000
    python3 test/fuzz.py --seed 17 --repeat npz 4711

The first two go through all targets with a new seed. A child process reads, so that a crash is a
finding, too, and does not end the run. Every finding names the command that repeats it.
"""

import argparse
import array
import copy
import ctypes
import dataclasses
import faulthandler
import logging
import multiprocessing
import os
import random
import re
import resource
import sys
import tempfile
import time
import tracemalloc
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

os.environ["OPENCV_LOG_LEVEL"] = "SILENT"
# Bags and messages for tests.
sys.path.append(str(Path(__file__).parents[1] / "grid_map_ros_py" / "test"))

import nav2_stand_in
import numpy as np
import octomap_stand_in

from grid_map_core_py import GridMap, Polygon
from grid_map_core_py.errors import GridMapError
from grid_map_ros_py import (
    from_costmap,
    from_grid_cells,
    from_image,
    from_message,
    from_occupancy_grid,
    from_octomap,
    from_point_cloud,
    from_polygon,
    from_serialized_message,
    octomap_to_points,
    read_points,
    to_color_image,
    to_grid_cells,
    to_image,
    to_message,
    to_occupancy_grid,
    to_point_cloud,
    to_polygon,
    to_serialized_message,
)
from grid_map_ros_py.messages import serialize, view

LONGEST = 2.0
"""CPU time that a reader may take [s]."""

LONGEST_WAIT = 10.0
"""Time that a reader may take [s], without that for which other processes have the processor."""

PATIENCE = 60.0
"""Time after which a reader hangs [s], on a busy machine; its process ends with a traceback."""

MOST_MEMORY = 32e6
"""Bytes that Python may allocate, besides a few times the map that a reader returns."""

MOST_RESIDENT = 500e6
"""Bytes by which the process may grow while it reads one input."""

HEAP = 2**32
"""Bytes of memory of the process, so that a reader that takes more fails alone."""

FLOATS = [0.0, -0.0, -1.0, 1e-320, 1e-30, 0.1, 3.0, 1e9, 1e300, np.inf, -np.inf, np.nan]
TEXTS = ["", "x", "y", "elevation", "rgb", "mono16", "32FC1", "OcTree", "row_index", "é" * 40]
WORDS = (
    b"0 -1 1e300 nan .inf 2024-13-45 null true [] {a: b} &a *a <<: ' # / .. ( : 99999999 "
    b"1:59:59.5 !!int !!float !!bool !!timestamp !!binary !!set".split()
)
"""Words that mean something in YAML, expressions and command lines."""


class Target(NamedTuple):
    """A reader with intact input."""

    name: str
    seeds: Sequence[Any]
    read: Callable[[Any], Any]


MakeTargets = Callable[[Path], list[Target]]


def world() -> GridMap:
    """A moved map of several layers."""
    generator = np.random.default_rng(3)
    layers = {name: generator.random((7, 5)) for name in ("elevation", "variance")}
    layers["elevation"][2, 3] = np.nan
    layers["color"] = generator.integers(0, 2**24, (7, 5), dtype=np.uint32).view(np.float32)
    grid_map = GridMap((0.7, 0.5), 0.1, layers=layers, frame_id="map", timestamp=12)
    grid_map.basic_layers = ["elevation"]
    grid_map.move((0.2, -0.1))
    return grid_map


def _octrees() -> tuple[Any, ...]:
    # Small leaves beside the origin.
    corner = (7, *([0] * 11))
    leaves = {(*corner, 1): True, (*corner, 2, 5): False, (*corner, 2, 6, 0, 3): True}
    data = octomap_stand_in.write_full(
        leaves, lambda occupied: np.float32(occupied - 0.5).tobytes()
    )
    binary = octomap_stand_in.message(octomap_stand_in.write_binary(leaves))
    return binary, octomap_stand_in.message(data, binary=False)


def _costmap() -> nav2_stand_in.Costmap:
    costmap = nav2_stand_in.Costmap(data=array.array("B", range(0, 252, 21)))
    costmap.metadata.resolution = float(np.float32(0.1))
    costmap.metadata.size_x, costmap.metadata.size_y = 3, 4
    return costmap


def _read_cloud(cloud: Any) -> GridMap:
    read_points(cloud)
    return from_point_cloud(cloud, resolution=0.1)


def _read_costmap(message: Any) -> Any:
    return from_costmap(message, "cost"), from_costmap(nav2_stand_in.PyCostmap2D(message), "cost")


def targets(folder: Path) -> list[Target]:
    """Return all readers of messages, files and texts; `folder` is for files."""
    # Needs optional packages.
    import fuzz_files
    import fuzz_mapping

    grid_map = world()
    images = [to_image(grid_map, "elevation", code) for code in ("mono16", "rgba8", "64FC1")]
    occupancies = to_occupancy_grid(grid_map, "elevation", 0.0, 1.0)
    cells = to_grid_cells(grid_map, "elevation", -np.inf, np.inf)
    polygon = to_polygon(Polygon([(0, 0), (1, 0), (1, 1), (0.2, 0.9)]))
    messages: list[tuple[tuple[Any, ...], Callable[[Any], Any]]] = [
        ((to_message(grid_map),), from_message),
        ((to_point_cloud(grid_map, "elevation"),), _read_cloud),
        ((occupancies,), lambda message: from_occupancy_grid(message, "elevation")),
        ((cells,), lambda message: from_grid_cells(message, "elevation")),
        (
            (to_color_image(grid_map, "color", "bgra8"), *images),
            lambda message: from_image(message, "elevation", 0.1),
        ),
        ((polygon,), from_polygon),
    ]
    result = []
    for seeds, read in messages:
        kind = type(seeds[0])
        result.append(Target(kind.__name__, seeds, read))
        from_bytes = lambda data, kind=kind, read=read: read(view(data, kind))  # noqa: E731
        result.append(Target(f"{kind.__name__} in CDR", tuple(map(serialize, seeds)), from_bytes))
    result += [
        Target("ReceivedMap", (to_serialized_message(grid_map),), from_serialized_message),
        Target("Costmap", (_costmap(),), _read_costmap),
        Target("Octomap", _octrees(), from_octomap),
        Target("points of Octomap", _octrees(), octomap_to_points),
        *(Target(*mapping) for mapping in fuzz_mapping.targets(grid_map)),
        *(Target(*files) for files in fuzz_files.targets(folder)),
    ]
    for target in result:
        # Let it import and compile what it needs, which is slow.
        for seed in target.seeds:
            target.read(seed)
    return result


# --- damage ---------------------------------------------------------------------------------------


def damaged(value: Any, generator: random.Random) -> Any:
    """Return a copy of bytes or of a message with random damage in a few places."""
    for _ in range(generator.choice([1, 1, 1, 2, 4])):
        if isinstance(value, bytes):
            value = _damaged_bytes(value, generator)
        else:
            value = copy.deepcopy(value)
            _damage_message(value, generator)
    return value


def _damaged_bytes(data: bytes, generator: random.Random) -> bytes:
    place, other = (generator.randrange(len(data) + 1) for _ in range(2))
    size = generator.choice([1, 2, 4, 4, 8, 64])
    rest = data[place + size :]
    match 5 if data.isascii() and generator.random() < 0.5 else generator.randrange(7):
        case 0:
            return data[:place]
        case 1:
            return data[:place] + rest
        case 2:
            piece = data[other : other + size]
            return data[:place] + piece * generator.choice([1, 1, 5, 500]) + data[place:]
        case 3:
            return data[:place] + generator.choice([b"\0", b"\xff", b"\x7f"]) * size + rest
        case 4:
            place -= place % 4
            number = generator.choice([0, 1, 3, 2**31 - 1, 2**32 - 1, generator.getrandbits(16)])
            return data[:place] + number.to_bytes(4, "little") + data[place + 4 :]
        case 5 if words := list(re.finditer(rb"[\w.+-]+", data)):
            word, model = generator.choices(words, k=2)
            new = generator.choice([model[0], *WORDS])
            return data[: word.start()] + new + data[word.end() :]
        case _:
            return data[:place] + generator.randbytes(size) + rest


def _fields(message: Any) -> dict[str, str]:
    if dataclasses.is_dataclass(message):
        kinds = {"resolution": "double", "size_x": "uint32", "size_y": "uint32"}
        return {f.name: kinds.get(f.name, "") for f in dataclasses.fields(message)}
    fields: dict[str, str] = message.get_fields_and_field_types()
    return fields


def _damage_message(message: Any, generator: random.Random) -> None:
    fields = _fields(message)
    name = generator.choice(list(fields))
    value = getattr(message, name)
    if hasattr(value, "get_fields_and_field_types") or dataclasses.is_dataclass(value):
        _damage_message(value, generator)
    elif isinstance(value, list):
        if value and not isinstance(value[0], str) and generator.random() < 0.7:
            _damage_message(generator.choice(value), generator)
        else:
            setattr(message, name, _damaged_list(value, generator))
    elif isinstance(value, array.array):
        setattr(message, name, _damaged_array(value, generator))
    elif isinstance(value, np.ndarray):
        value[generator.randrange(len(value))] = generator.choice(FLOATS)
    else:
        setattr(message, name, _another(value, fields[name], generator))


def _damaged_list(items: list[Any], generator: random.Random) -> list[Any]:
    if not items:
        return items
    place = generator.randrange(len(items))
    match generator.randrange(4):
        case 0:
            return items[:place] + items[place + 1 :]
        case 1:
            return [*items, items[place]]
        case 2:
            return []
        case _:
            if isinstance(items[0], str):
                return [*items[:place], generator.choice(TEXTS), *items[place + 1 :]]
            return items[::-1]


def _damaged_array(values: "array.array[Any]", generator: random.Random) -> "array.array[Any]":
    data = _damaged_bytes(values.tobytes(), generator)
    result = array.array(values.typecode)
    result.frombytes(data[: len(data) // values.itemsize * values.itemsize])
    return result


def _another(value: Any, kind: str, generator: random.Random) -> Any:
    """Return a value of a message type, at a limit of its range or next to `value`."""
    if isinstance(value, str):
        return generator.choice(TEXTS)
    if isinstance(value, bool):
        return not value
    if isinstance(value, float):
        number = generator.choice([*FLOATS, value * 2, -value])
        # A float is single precision on the wire, and infinite beyond its range.
        with np.errstate(over="ignore"):
            return float(np.float32(number)) if kind == "float" else number
    bits = int("".join(filter(str.isdigit, kind)) or 8)
    largest = 2 ** (bits - (not kind.startswith("uint"))) - 1
    smallest = 0 if kind.startswith("uint") else -largest - 1
    numbers = [0, 1, 2, value + 1, value - 1, value * 2, largest, smallest, 70_000]
    return min(max(generator.choice(numbers), smallest), largest)


# --- the loop -------------------------------------------------------------------------------------


class Progress(ctypes.Structure):
    """Position and figures of a run, in memory that it shares with its child processes."""

    _fields_ = (
        ("target", ctypes.c_long),
        ("name", ctypes.c_char * 40),
        ("number", ctypes.c_long),
        ("read", ctypes.c_long),
        ("inputs", ctypes.c_long),
        ("findings", ctypes.c_long),
        ("seconds", ctypes.c_double),
        ("slowest", ctypes.c_double),
        ("peak", ctypes.c_double),
    )


@cache
def _open(name: str, mode: int) -> int:
    return os.open(f"/proc/thread-self/{name}", mode)


def _reset_peak() -> int:
    """Forget the peak of resident memory; return the memory [bytes]."""
    os.pwrite(_open("clear_refs", os.O_WRONLY), b"5", 0)
    return _resident_peak()


def _resident_peak() -> int:
    # That of `getrusage` includes what the parent had when it made this process.
    status = os.pread(_open("status", os.O_RDONLY), 4000, 0)
    return 1024 * int(status.partition(b"VmHWM:")[2].split()[0])


def _own_time() -> float:
    """Return the time [s], without that for which this thread has waited for a processor."""
    delay = int(os.pread(_open("schedstat", os.O_RDONLY), 100, 0).split()[1])
    return time.monotonic() - 1e-9 * delay


def attempt(target: Target, seed: int, number: int) -> tuple[bool, float, float]:
    """Read one damaged input.

    Returns:
        Whether it was read rather than refused, the CPU time [s], and the peak of memory [bytes].

    Raises:
        AssertionError: the reader did something else, or needed too much.
    """
    generator = random.Random(f"{seed} {target.name} {number}")
    value = damaged(generator.choice(target.seeds), generator)
    resident = _reset_peak()
    tracemalloc.start()
    begin, wait_begin = time.process_time(), _own_time()
    result, is_read = None, True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            result = target.read(value)
    except GridMapError:
        is_read = False
    except Exception as error:
        raise AssertionError(f"{type(error).__name__}: {error}") from error
    finally:
        duration, waited = time.process_time() - begin, _own_time() - wait_begin
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert duration < LONGEST, f"{duration:.1f} s"
    assert waited < LONGEST_WAIT, f"waited until {waited:.1f} s"
    assert peak < MOST_MEMORY + 6 * _size(result), f"{peak} bytes for a result of {_size(result)}"
    # Libraries in C have their own memory.
    grown = _resident_peak() - resident
    assert grown < MOST_RESIDENT, f"{grown} bytes resident"
    return is_read, duration, max(peak, grown)


def _size(result: Any) -> int:
    """Return the size of a reader's result [bytes]: a map, an array, or several."""
    if isinstance(result, tuple):
        return sum(map(_size, result))
    if isinstance(result, GridMap):
        return sum(result[name].nbytes for name in result)
    return getattr(result, "nbytes", 0)


def fuzz(make_targets: MakeTargets, seed: int, *, seconds: float, inputs: float) -> tuple[int, int]:
    """Read damaged input of all targets, print their figures, and go on after a crash.

    Args:
        make_targets: function of a module, which returns the targets; it gets a folder for files.
        seed: seed of the damage.
        seconds: time for all targets together.
        inputs: number of inputs of all targets together.

    Returns:
        The numbers of inputs and of findings.
    """
    spawning = multiprocessing.get_context("spawn")
    progress = spawning.Value(Progress, lock=False)
    while True:
        progress.name = b""
        with tempfile.TemporaryDirectory() as folder:
            given = make_targets, Path(folder), progress, seed, seconds, inputs
            child = spawning.Process(target=_work, args=given)
            child.start()
            child.join()
        if child.exitcode == 0:
            return progress.inputs, progress.findings
        assert progress.name, "no target can be made"
        _find(progress, seed, f"the process ended with code {child.exitcode}")


def _work(
    make_targets: MakeTargets,
    folder: Path,
    progress: Any,
    seed: int,
    seconds: float,
    inputs: float,
) -> None:
    faulthandler.enable()
    logging.disable()
    resource.setrlimit(resource.RLIMIT_DATA, (HEAP, HEAP))
    # Readers use temporary files, too.
    tempfile.tempdir = str(folder)
    chosen, armed = make_targets(folder), -np.inf
    while progress.target < len(chosen):
        target = chosen[progress.target]
        progress.name = target.name.encode()
        while progress.number * len(chosen) < inputs and progress.seconds * len(chosen) < seconds:
            begin = time.monotonic()
            # Starting the timer anew takes longer than most inputs.
            if begin - armed > PATIENCE / 10:
                faulthandler.dump_traceback_later(PATIENCE, exit=True)
                armed = begin
            try:
                is_read, duration, peak = attempt(target, seed, progress.number)
            except AssertionError as error:
                _find(progress, seed, str(error))
            else:
                progress.read += is_read
                progress.slowest = max(progress.slowest, duration)
                progress.peak = max(progress.peak, peak)
                progress.number += 1
                progress.inputs += 1
            progress.seconds += time.monotonic() - begin
        print(
            f"{target.name:26} {progress.number:8} inputs {progress.read:8} read"
            f" {progress.slowest:7.3f} s {1e-6 * progress.peak:5.0f} MB",
            flush=True,
        )
        progress.target += 1
        progress.number = progress.read = 0
        progress.seconds = progress.slowest = progress.peak = 0.0


def _find(progress: Any, seed: int, what: str) -> None:
    """Print a finding, and go on with the next input."""
    name = progress.name.decode()
    print(f"finding: --seed {seed} --repeat {name!r} {progress.number}: {what[:500]}", flush=True)
    progress.number += 1
    progress.inputs += 1
    progress.findings += 1


def main() -> int:
    """Fuzz all targets and print the results; return 1 if there are findings."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=np.inf, help="for all targets together")
    parser.add_argument("--inputs", type=int, default=np.inf, help="for all targets together")
    parser.add_argument("--seed", type=int, default=random.randrange(2**32))
    parser.add_argument("--repeat", nargs=2, metavar=("TARGET", "NUMBER"), help="read one input")
    options = parser.parse_args()
    if options.repeat:
        name, number = options.repeat
        with tempfile.TemporaryDirectory() as folder:
            target = next(one for one in targets(Path(folder)) if one.name == name)
            print(attempt(target, options.seed, int(number)))
        return 0
    inputs, findings = fuzz(targets, options.seed, seconds=options.seconds, inputs=options.inputs)
    print(f"{inputs} inputs with seed {options.seed}, {findings} findings")
    return findings > 0


if __name__ == "__main__":
    sys.exit(main())
