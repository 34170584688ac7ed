# SPDX-License-Identifier: BSD-3-Clause
"""Temporary files and folders, removed at the end or by a signal."""

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

_paths: set[Path] = set()


@contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """Remove a file, link or folder on exit, if it still has this name."""
    _paths.add(path)
    try:
        yield path
    finally:
        remove(path)
        _paths.discard(path)


def scratch_folder() -> AbstractContextManager[Path]:
    """Return a new folder that is removed at the end."""
    return unfinished(Path(tempfile.mkdtemp(prefix="grid-map-")))


def remove(path: Path) -> None:
    """Remove a file, a link or a folder, if it is there."""
    if path.is_symlink() or not path.is_dir():
        path.unlink(missing_ok=True)
        return
    for _ in range(50):
        shutil.rmtree(path, ignore_errors=True)
        if not path.exists():
            return
        # After an error, threads of Zarr may still write into the folder.
        time.sleep(0.02)


def remove_all() -> None:
    """Remove all unfinished files and folders, before the process ends."""
    for path in [*_paths]:
        remove(path)
