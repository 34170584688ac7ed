# SPDX-License-Identifier: BSD-3-Clause
"""Temporary files and folders, removed at the end or by a signal."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

_paths: set[Path] = set()


@contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """Remove a file, a link or a folder at the end, if it still has this name then."""
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
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def remove_all() -> None:
    """Remove all unfinished files and folders, before the process ends."""
    for path in [*_paths]:
        remove(path)
