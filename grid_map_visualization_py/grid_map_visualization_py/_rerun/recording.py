# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of Rerun in files, and bags in recordings."""

import os
import shutil
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any, Self

from grid_map_core_py.errors import GridMapError, LimitError
from grid_map_core_py.files import new_file
from grid_map_ros_py import BagError, BagMessage, MessageError, bag_messages

from .scene import GRID_MAP_TYPE, SHOWN_TYPES, Scene, Style, rerun

_BLOCK = 1 << 20
"""Bytes that are read from the pipe at once."""


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
    try:
        with new_file(path) as temporary, _Writer(temporary) as writer:
            recording = rerun().RecordingStream("grid_map")
            recording.save(writer.path)
            try:
                scene = _SceneInFile(recording, style, writer)
                yield scene
                scene.send_layout()
            finally:
                recording.disconnect()
    except OSError as error:
        raise GridMapError(f"{path}: cannot be written: {error.strerror or error}") from error


class _Writer:
    """A thread that writes to a file what comes through a pipe.

    Rerun waits forever for a file that it cannot write, such as on a full disk; this thread reads
    on in that case, and keeps the error.
    """

    def __init__(self, target: Path) -> None:
        self._target = target
        self._error: OSError | None = None
        self._source, self._sink = os.pipe()
        self._thread = threading.Thread(target=self._write, daemon=True)

    @property
    def path(self) -> str:
        """The end of the pipe that Rerun opens as its file."""
        return f"/dev/fd/{self._sink}"

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        os.close(self._sink)
        self._thread.join()
        if kind is None:
            self.check()

    def check(self) -> None:
        """Raise the error of the file, if there is one."""
        if self._error is not None:
            raise self._error

    def _write(self) -> None:
        with os.fdopen(self._source, "rb", buffering=0) as source:
            try:
                with self._target.open("wb") as target:
                    shutil.copyfileobj(source, target, _BLOCK)
            except OSError as error:
                self._error = error
            while source.read(_BLOCK):
                pass


class _SceneInFile(Scene):
    """A scene that ends with the first error of its file."""

    def __init__(self, recording: Any, style: Style | None, writer: _Writer) -> None:
        super().__init__(recording, style)
        self._writer = writer

    def _set_times(self, ros_time: int, log_time: int | None) -> None:
        self._writer.check()
        super()._set_times(ros_time, log_time)


def log_bag(
    scene: Scene,
    path: str | PathLike[str],
    *,
    topic: str | None = None,
    recover: bool = False,
    goes_on: Callable[[int], bool] = lambda _: True,
) -> int:
    """Write the messages of a bag to a scene in time order, one at a time.

    Messages that cannot be shown, such as a pose with NaN, are left out with a warning for each
    topic, as RViz does. A damaged map is an error, unless `recover` is true.

    Args:
        scene: where they go.
        path: the bag.
        topic: only this topic of maps, and all other messages; None means all.
        recover: read what is there of a damaged bag, and leave out damaged maps.
        goes_on: is called after each message with its time [ns]; False ends.

    Returns:
        The number of messages that are shown.

    Raises:
        BagError: the bag or a map is damaged.
        LimitError: a map has too many cells.
    """
    count, left_out = 0, Counter[str]()
    for message in _chosen(path, topic, recover):
        try:
            scene.log_message(message.topic, message.type, message.data, log_time=message.time)
        except (MessageError, LimitError) as error:
            if message.type == GRID_MAP_TYPE and not recover:
                raise _named(message.place, error) from error
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


def _chosen(path: str | PathLike[str], topic: str | None, recover: bool) -> Iterator[BagMessage]:
    """Yield the messages of a bag that are shown; of the maps, those on a topic."""
    for message in bag_messages(path, SHOWN_TYPES, recover=recover):
        if message.type != GRID_MAP_TYPE or topic in (None, message.topic):
            yield message


def _named(place: str, error: GridMapError) -> GridMapError:
    """Return an error that names the map."""
    if isinstance(error, LimitError):
        return LimitError(f"{place}: {error}")
    return BagError(place, f"{error}; recover=True (--recover) leaves out such maps")
