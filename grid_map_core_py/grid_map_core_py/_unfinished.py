# SPDX-License-Identifier: BSD-3-Clause
"""Temporary files and folders that are removed on exit, even if a signal ends the process."""

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

_paths: set[Path] = set()


@contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """Remove the file, link or folder `path` when the context exits, unless it was renamed."""
    _paths.add(path)
    try:
        yield path
    finally:
        remove(path)
        _paths.discard(path)


def scratch_folder() -> AbstractContextManager[Path]:
    """Return a context manager for a new temporary folder, which is removed on exit."""
    return unfinished(Path(tempfile.mkdtemp(prefix="grid-map-")))


def remove(path: Path) -> None:
    """Remove a file, link or folder if it exists."""
    if path.is_symlink() or not path.is_dir():
        path.unlink(missing_ok=True)
        return
    for _ in range(50):
        shutil.rmtree(path, ignore_errors=True)
        if not path.exists():
            return
        # After an error, Zarr threads may still be writing to the folder.
        time.sleep(0.02)


def remove_all() -> None:
    """Remove all unfinished files and folders; called before the process ends."""
    for path in [*_paths]:
        remove(path)
