# SPDX-License-Identifier: BSD-3-Clause
"""Atomic writing of files and folders: complete or not at all.

They are written beside the target, under a hidden name that ends in `.partial`, flushed to disk,
and renamed. An error or the end of the process before that leaves the old ones. A process
that is killed leaves its `.partial` behind, which can be deleted.
"""

import ctypes
import errno
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from os import PathLike
from pathlib import Path

from .._unfinished import remove, unfinished

_DESCRIPTORS = Path("/proc/self/fd")
_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
_TAKEN = {errno.EEXIST, errno.ENOTDIR, errno.ENOTEMPTY}
_NOT_SUPPORTED = {errno.ENOSYS, errno.EINVAL, errno.ENOTSUP}


@contextmanager
def new_file(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield a temporary name; on success the file written there replaces the one at `path`.

    Raises:
        OSError: the folder is missing or cannot be written to; it names `path`.
    """
    target = Path(path).resolve()
    temporary = _hidden(target, "partial")
    with _errors_of(path, temporary), unfinished(temporary):
        temporary.touch(exist_ok=False)
        yield temporary
        _sync(temporary)
        temporary.replace(target)
        _sync(target.parent)


@contextmanager
def new_folder(path: str | PathLike[str], check_old: Callable[[Path], object]) -> Iterator[Path]:
    """Yield an empty temporary folder; on success it replaces the one at `path`.

    On systems that can exchange two names (Linux, on most file systems) the old folder or the new
    one is there at every instant. Elsewhere the old one has a hidden name that ends in `.old` for
    an instant.

    Args:
        path: where the folder belongs.
        check_old: called with an existing folder or file, before anything is written and before it
            is replaced; it raises to keep it.

    Raises:
        OSError: the parent folder is missing or cannot be written to; it names `path`.
    """
    target = Path(path) if has_descriptor(path) else Path(path).resolve()
    if target.exists():
        check_old(target)
    temporary = _hidden(target, "partial")
    with _errors_of(path, temporary), unfinished(temporary):
        temporary.mkdir()
        with _pinned(temporary) as folder:
            yield folder
            for file in folder.iterdir():
                _sync(file)
            _sync(folder)
        if target.exists():
            check_old(target)
        try:
            temporary.rename(target)
        except OSError as error:
            if error.errno not in _TAKEN:
                raise
            # Another process may have created it in the meantime.
            check_old(target)
            replace_folder(temporary, target)
        _sync(target.parent)


def has_descriptor(path: str | PathLike[str]) -> bool:
    """Return whether a path begins with a descriptor of this process: /proc/self/fd/7/map.

    Such a path stays below its folder, whatever happens to the names above: no link is followed.
    """
    return Path(path).parts[: len(_DESCRIPTORS.parts)] == _DESCRIPTORS.parts


@contextmanager
def _pinned(folder: Path) -> Iterator[Path]:
    """Yield a path of a folder that a link in place of the folder does not divert, if possible."""
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        pinned = _DESCRIPTORS / str(number)
        pinned = pinned if pinned.exists() else folder
        with _errors_of(folder, pinned):
            yield pinned
    finally:
        os.close(number)


@contextmanager
def _errors_of(path: str | PathLike[str], temporary: Path) -> Iterator[None]:
    """Let errors name the path that the caller gave, in place of the temporary one."""
    if not temporary.parent.is_dir():
        given = Path(path).parent
        folder = temporary.parent if given.is_dir() else given
        raise FileNotFoundError(errno.ENOENT, f"there is no folder {folder}", str(path))
    try:
        yield
    except OSError as error:
        if str(temporary) in str(error.filename):
            error.filename, error.filename2 = str(path), None
        # Libraries put the name into a text.
        error.args = tuple(
            part.replace(str(temporary), str(path)) if isinstance(part, str) else part
            for part in error.args
        )
        raise


def replace_folder(temporary: Path, target: Path) -> None:
    """Replace a folder by another one, which may have the old content afterwards."""
    if _exchange(temporary, target):
        return
    aside = _hidden(target, "old")
    target.rename(aside)
    try:
        temporary.rename(target)
    except OSError:
        aside.rename(target)
        raise
    remove(aside)


def _exchange(one: Path, other: Path) -> bool:
    """Swap the names of two folders atomically; return False if the system cannot."""
    try:
        rename = _c_library().renameat2
    except AttributeError:
        return False
    if rename(_AT_FDCWD, bytes(one), _AT_FDCWD, bytes(other), _RENAME_EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in _NOT_SUPPORTED:
        return False
    raise OSError(number, os.strerror(number), str(other))


@cache
def _c_library() -> ctypes.CDLL:
    """Return the C library, which is a new class for Python each time it is opened."""
    return ctypes.CDLL(None, use_errno=True)


def _hidden(target: Path, kind: str) -> Path:
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}.{kind}")


def _sync(path: Path) -> None:
    """Flush a file to disk, or the names in a folder if the file system supports that."""
    file = os.open(path, os.O_RDONLY)
    try:
        os.fsync(file)
    except OSError as error:
        if error.errno not in _NOT_SUPPORTED:
            raise
    finally:
        os.close(file)
