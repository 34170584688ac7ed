# SPDX-License-Identifier: BSD-3-Clause
"""Temporary files and folders that are removed on exit, even if a signal ends the process."""

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
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
    with unfinished(Path(tempfile.mkdtemp(prefix="grid-map-scratch-"))) as folder:
        yield folder


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
