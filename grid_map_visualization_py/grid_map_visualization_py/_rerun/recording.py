# SPDX-License-Identifier: BSD-3-Clause
"""Write Rerun recordings to files, and bags to Rerun recordings."""

import os
import shutil
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from grid_map_core_py.errors import GridMapError, LimitError
from grid_map_core_py.files._shared import new_file
from grid_map_ros_py import BagError, MessageError, bag_messages

from .scene import GRID_MAP_TYPE, SHOWN_TYPES, Scene, Style, rerun


@contextmanager
def recorded(path: str | PathLike[str], style: Style | None = None) -> Iterator[Scene]:
    """Open a Rerun file (`.rrd`), and yield a scene that writes to this file.

    The file is written completely or not at all.

    Args:
        path: path of the file; an existing file is replaced.
        style: style of the maps.

    Raises:
        MissingPackageError: Rerun is not installed.
        GridMapError: the file cannot be written.
    """
    try:
        with new_file(path) as temporary, _pipe_into(temporary) as (pipe, errors):
            recording = rerun().RecordingStream("grid_map")
            recording.save(pipe)
            try:
                scene = Scene(recording, style)
                scene._errors = errors
                yield scene
                scene.send_layout()
            finally:
                recording.disconnect()
    except OSError as error:
        raise GridMapError(f"{path}: cannot be written: {error.strerror or error}") from error


@contextmanager
def _pipe_into(target: Path) -> Iterator[tuple[str, list[OSError]]]:
    """Yield the path of a pipe to the file `target`, and a list of write errors.

    Without the pipe, Rerun would block forever on a full disk.
    """
    source, sink = os.pipe()
    errors: list[OSError] = []

    def write() -> None:
        with os.fdopen(source, "rb", buffering=0) as pipe:
            try:
                with target.open("wb") as file:
                    shutil.copyfileobj(pipe, file)
            except OSError as error:
                errors.append(error)
            while pipe.read(1 << 16):
                pass

    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    try:
        yield f"/dev/fd/{sink}", errors
    finally:
        os.close(sink)
        thread.join()
    if errors:
        raise errors[0]


def log_bag(
    scene: Scene,
    path: str | PathLike[str],
    *,
    topic: str | None = None,
    recover: bool = False,
    goes_on: Callable[[int], bool] = lambda _: True,
) -> int:
    """Write the messages of a bag to a scene, in time order.

    Messages that cannot be shown, such as a pose with NaN, are skipped. A warning names each
    affected topic. Maps with errors are skipped only if `recover` is true.

    Args:
        topic: the map topic to write; None means all map topics. Other topics are always written.
        recover: read the undamaged part of the bag, and skip maps that cause errors.
        goes_on: called with the time [ns] of each written message; returns False to stop.

    Returns:
        Number of messages written.

    Raises:
        BagError: the bag or a map is damaged.
        LimitError: a map has too many cells, and `recover` is false.
    """
    count, left_out = 0, Counter[str]()
    for message in bag_messages(path, SHOWN_TYPES, recover=recover):
        is_map = message.type == GRID_MAP_TYPE
        if is_map and topic not in (None, message.topic):
            continue
        try:
            scene.log_message(message.topic, message.type, message.data, log_time=message.time)
        except (MessageError, LimitError) as error:
            if is_map and not recover:
                if isinstance(error, LimitError):
                    raise LimitError(f"{message.place}: {error}") from error
                hint = "recover=True (--recover) leaves out such maps"
                raise BagError(message.place, f"{error}; {hint}") from error
            left_out[message.topic] += 1
            if left_out[message.topic] == 1:
                warnings.warn(f"left out: {message.place}: {error}", stacklevel=2)
            continue
        count += 1
        if not goes_on(message.time):
            break
    for name, number in left_out.items():
        if number > 1:
            warnings.warn(f"left out: {number - 1} more messages on {name}", stacklevel=2)
    return count
