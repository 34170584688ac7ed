# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of Rerun in files, and bags in recordings."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike

from grid_map_core_py.errors import GridMapError, LimitError
from grid_map_core_py.files import new_file
from grid_map_ros_py import BagError, MessageError, bag_messages

from .scene import GRID_MAP_TYPE, SHOWN_TYPES, Scene, Style, rerun


@contextmanager
def recorded(path: str | PathLike[str], style: Style | None = None) -> Iterator[Scene]:
    """Yield a scene that is written to a file (`.rrd`), which appears complete or not at all.

    Args:
        path: the file; one that is there is replaced.
        style: how maps are drawn.

    Raises:
        MissingPackageError: Rerun is not installed.
        GridMapError: the file cannot be written.
    """
    recording = rerun().RecordingStream("grid_map")
    try:
        with new_file(path) as temporary:
            recording.save(temporary)
            try:
                scene = Scene(recording, style)
                yield scene
                scene.send_layout()
                recording.flush()
            finally:
                recording.disconnect()
    except OSError as error:
        raise GridMapError(f"{path}: cannot be written: {error.strerror or error}") from error


def log_bag(
    scene: Scene,
    path: str | PathLike[str],
    *,
    topic: str | None = None,
    recover: bool = False,
    tell: Callable[[str], object] = lambda _: None,
    goes_on: Callable[[int], bool] = lambda _: True,
) -> int:
    """Write the messages of a bag to a scene in time order, one at a time.

    Args:
        scene: where they go.
        path: the bag.
        topic: only this topic of maps, and all other messages; None means all.
        recover: read what is there of a damaged bag, and leave out damaged messages.
        tell: is called with a text about each message that is left out.
        goes_on: is called after each message with its time [ns]; False ends.

    Returns:
        The number of messages that are shown.

    Raises:
        BagError: the bag or a message is damaged.
        LimitError: a map has too many cells.
    """
    count = 0
    for message in bag_messages(path, SHOWN_TYPES, recover=recover):
        if topic not in (None, message.topic) and message.type == GRID_MAP_TYPE:
            continue
        try:
            scene.log_message(message.topic, message.type, message.data, log_time=message.time)
        except (MessageError, LimitError) as error:
            if not recover:
                raise _named(message.place, error) from error
            tell(f"left out: {_named(message.place, error)}")
            continue
        count += 1
        if not goes_on(message.time):
            break
    return count


def _named(place: str, error: GridMapError) -> GridMapError:
    """Return an error that names the message."""
    if isinstance(error, LimitError):
        return LimitError(f"{place}: {error}")
    return BagError(place, str(error))
