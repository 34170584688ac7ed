# SPDX-License-Identifier: BSD-3-Clause
"""Fuzzing of readers of messages and files: damaged input raises `GridMapError`.

Readers of messages must do so in little memory.

    python3 test/fuzz.py --seconds 60
    python3 test/fuzz.py --inputs 1000000
    python3 test/fuzz.py --seed 17 --repeat npz 4711

The first two go through all targets with a new seed. Every finding names the command that repeats
it. A crash, or a reader that hangs, ends the run with a traceback.
"""

import argparse
import array
import copy
import dataclasses
import faulthandler
import logging
import os
import random
import sys
import tempfile
import time
import tracemalloc
import warnings
from collections.abc import Callable, Sequence
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

PATIENCE = 60.0
"""Time after which a reader hangs [s], on a busy machine."""

MOST_MEMORY = 32e6
"""Bytes that a reader of messages may allocate, besides a few times the map that it returns."""

FLOATS = [0.0, -0.0, -1.0, 1e-320, 1e-30, 0.1, 3.0, 1e9, 1e300, np.inf, -np.inf, np.nan]
TEXTS = ["", "x", "y", "elevation", "rgb", "mono16", "32FC1", "OcTree", "row_index", "é" * 40]


class Target(NamedTuple):
    """A reader with intact input; `limited` ones are tested for the memory that they need."""

    name: str
    seeds: Sequence[Any]
    read: Callable[[Any], Any]
    limited: bool = True


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
    later = nav2_stand_in.LaterPyCostmap2D(message)
    return from_costmap(message, "cost"), from_costmap(later, "cost")


def targets(folder: Path) -> list[Target]:
    """Return all readers of messages and files; `folder` is for files."""
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
        *(Target(*files, limited=False) for files in fuzz_files.targets(folder)),
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
    match generator.randrange(6):
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


def attempt(target: Target, seed: int, number: int) -> bool:
    """Read one damaged input, and return whether it was read rather than refused.

    Raises:
        AssertionError: the reader did something else, or needed too much memory.
    """
    generator = random.Random(f"{seed} {target.name} {number}")
    value = damaged(generator.choice(target.seeds), generator)
    result = None
    tracemalloc.start()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", UserWarning)
            result = target.read(value)
    except GridMapError:
        return False
    except Exception as error:
        raise AssertionError(f"{type(error).__name__}: {error}") from error
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        allowed = MOST_MEMORY + 6 * _size(result)
        assert not target.limited or peak < allowed, f"{peak} bytes for a result of {_size(result)}"
    return True


def _size(result: Any) -> int:
    """Return the size of a reader's result [bytes]: a map, an array, or several."""
    if isinstance(result, tuple):
        return sum(map(_size, result))
    if isinstance(result, GridMap):
        return sum(result[name].nbytes for name in result)
    return getattr(result, "nbytes", 0)


def fuzz(chosen: Sequence[Target], seed: int, *, seconds: float, inputs: float) -> int:
    """Read damaged input of all targets, print findings, and return their number."""
    findings = 0
    for target in chosen:
        number = read = 0
        end = time.monotonic() + seconds / len(chosen)
        while number * len(chosen) < inputs and time.monotonic() < end:
            faulthandler.dump_traceback_later(PATIENCE, exit=True)
            try:
                read += attempt(target, seed, number)
            except AssertionError as error:
                findings += 1
                repeat = f"--seed {seed} --repeat {target.name!r} {number}"
                print(f"finding: {repeat}: {str(error)[:500]}", flush=True)
            number += 1
        print(f"{target.name:26} {number:8} inputs {read:8} read", flush=True)
    faulthandler.cancel_dump_traceback_later()
    return findings


def main() -> int:
    """Fuzz all targets and print the results; return 1 if there are findings."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=np.inf, help="for all targets together")
    parser.add_argument("--inputs", type=int, default=np.inf, help="for all targets together")
    parser.add_argument("--seed", type=int, default=random.randrange(2**32))
    parser.add_argument("--repeat", nargs=2, metavar=("TARGET", "NUMBER"), help="read one input")
    options = parser.parse_args()
    faulthandler.enable()
    logging.disable()
    with tempfile.TemporaryDirectory() as folder:
        made = targets(Path(folder))
        if options.repeat:
            name, number = options.repeat
            target = next(one for one in made if one.name == name)
            print(attempt(target, options.seed, int(number)))
            return 0
        given = {"seconds": options.seconds, "inputs": options.inputs}
        findings = fuzz(made, options.seed, **given)
    print(f"{findings} findings with seed {options.seed}")
    return findings > 0


if __name__ == "__main__":
    sys.exit(main())
