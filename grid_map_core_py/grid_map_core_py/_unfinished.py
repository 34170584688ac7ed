# SPDX-License-Identifier: BSD-3-Clause
"""Temporary files and folders that are removed on exit, even if a signal ends the process."""

import fcntl
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_paths: set[Path] = set()
notes: set[str] = set()
"""Hints shown to the user if a command fails or a signal ends it, such as how to resume it."""


@contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """Remove the file or folder on exit, unless it was renamed."""
    _paths.add(path)
    try:
        yield path
    finally:
        remove(path)
        _paths.discard(path)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Yield a temporary folder that is removed on exit."""
    # Remove the folders of killed processes.
    for left in Path(tempfile.gettempdir()).glob("grid-map-scratch-????????"):
        with suppress(OSError), _locked(left):
            remove(left)
    new = Path(tempfile.mkdtemp(prefix=".grid-map-scratch-"))
    # The folder is locked before it gets the name that other processes look for.
    with _locked(new), unfinished(new.with_name(new.name[1:])) as folder:
        yield new.rename(folder)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock a folder, or raise `OSError` if another process has locked it."""
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(number)


def remove(path: Path) -> None:
    """Remove a file, link or folder if it exists."""
    if path.is_symlink() or not path.is_dir():
        path.unlink(missing_ok=True)
        return
    for _ in range(50):
        shutil.rmtree(path, ignore_errors=True)
        if not path.exists():
            return
        # After an error, Zarr threads may still write to the folder, so try again.
        time.sleep(0.02)


def remove_all() -> None:
    for path in [*_paths]:
        remove(path)
