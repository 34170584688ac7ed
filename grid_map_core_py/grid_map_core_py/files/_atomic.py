# SPDX-License-Identifier: BSD-3-Clause
"""Atomic writing of files and folders: beside the target under a hidden name, then renamed."""

import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from .._unfinished import remove, unfinished


@contextmanager
def new_file(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield a temporary name; on success the file written there replaces the one at `path`.

    Raises:
        OSError: the folder is missing or cannot be written to; it names `path`.
    """
    with _beside(path) as (temporary, target):
        yield temporary
        _sync(temporary)
        temporary.replace(target)


@contextmanager
def new_folder(path: str | PathLike[str], check_old: Callable[[Path], object]) -> Iterator[Path]:
    """Yield an empty temporary folder; on success it replaces the one at `path`.

    Args:
        path: path of the folder.
        check_old: called with an existing folder or file, before anything is written and before it
            is replaced; it raises to keep it.

    Raises:
        OSError: the parent folder is missing or cannot be written to; it names `path`.
    """
    with _beside(path) as (temporary, target):
        if target.exists():
            check_old(target)
        temporary.mkdir()
        yield temporary
        for file in temporary.iterdir():
            _sync(file)
        if target.exists():
            check_old(target)
            replace_folder(temporary, target)
        else:
            temporary.rename(target)


def replace_folder(temporary: Path, target: Path) -> None:
    """Replace a folder by another one; the old one has a hidden name for an instant."""
    old = target.with_name(f".{target.name}.{secrets.token_hex(4)}.old")
    target.rename(old)
    try:
        temporary.rename(target)
    except OSError:
        old.rename(target)
        raise
    remove(old)


@contextmanager
def _beside(path: str | PathLike[str]) -> Iterator[tuple[Path, Path]]:
    """Yield a temporary name, which errors do not show, and the target without links."""
    target = Path(path).resolve()
    if not target.parent.is_dir():
        raise FileNotFoundError(2, f"there is no folder {Path(path).parent}", str(path))
    name = target.with_name(f".{target.name}.{secrets.token_hex(4)}.partial")
    try:
        with unfinished(name) as temporary:
            yield temporary, target
    except OSError as error:
        if str(name) in str(error.filename):
            error.filename, error.filename2 = str(path), None
        raise


def _sync(path: Path) -> None:
    """Flush a file or the names in a folder to disk."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
