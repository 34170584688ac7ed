# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of Rerun in files, and bags in recordings."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

from grid_map_core_py.errors import GridMapError, LimitError
from grid_map_core_py.files import new_file
from grid_map_ros_py import BagError, MessageError, bag_messages

from .scene import GRID_MAP_TYPE, SHOWN_TYPES, Scene, Style, rerun

_PROBE = 1 << 16
"""Bytes that do not fit on a disk that was full a moment before; the first ones may in part."""

_PERIOD = 2.0
"""Time between two looks whether Rerun still writes [s]."""


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
            try:
                with _writing(temporary):
                    recording.save(temporary)
                scene = Scene(recording, style)
                yield scene
                scene.send_layout()
                with _writing(temporary):
                    _flush(recording, temporary)
            finally:
                recording.disconnect()
    except OSError as error:
        raise GridMapError(f"{path}: cannot be written: {error.strerror or error}") from error


def _flush(recording: Any, path: Path) -> None:
    """Wait until all is written; a call of Rerun may wait forever if its thread ends meanwhile."""
    size = -1
    while True:
        try:
            recording.flush(timeout_sec=_PERIOD)
        except RuntimeError:
            size, before = path.stat().st_size, size
            if size == before:
                raise
        else:
            return


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn an error of Rerun that stands for one of the file into that, an OSError."""
    try:
        yield
    except RuntimeError as error:
        # Rerun has stopped to write, and does not always say why; another write does.
        with path.open("ab", buffering=0) as file:
            file.write(bytes(_PROBE))
            file.write(bytes(_PROBE))
        raise OSError(str(error)) from error


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
