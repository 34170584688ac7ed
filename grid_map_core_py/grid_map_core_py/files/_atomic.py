# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Files and folders that are written atomically.

They are written beside the place where they belong, under a hidden name that ends in `.partial`,
and renamed once the disk has them. Whatever happens before, an error or the end of the process,
leaves what was there. Remains of processes that died are removed by the next one that writes to the
same place.
"""

import ctypes
import errno
import fcntl
import glob
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
_TAKEN = {errno.EEXIST, errno.ENOTDIR, errno.ENOTEMPTY}
_NOT_SUPPORTED = {errno.ENOSYS, errno.EINVAL, errno.ENOTSUP}


@contextmanager
def new_file(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield the name under which to write a file, which replaces the one at `path` in the end.

    Raises:
        OSError: the folder cannot be written to.
    """
    target = Path(path).resolve()
    _remove_abandoned(target)
    temporary, lock = _claimed(target, _make_file)
    try:
        yield temporary
        _sync(temporary)
        temporary.replace(target)
        _sync(target.parent)
    finally:
        os.close(lock)
        temporary.unlink(missing_ok=True)


@contextmanager
def new_folder(path: str | PathLike[str], check_old: Callable[[Path], object]) -> Iterator[Path]:
    """Yield an empty folder to write files into, which replaces the one at `path` in the end.

    Where the system can exchange two names (Linux), the old folder or the new one is there at every
    instant. Elsewhere the old one is put aside first; if the process dies just then, `find_folder`
    and the next `new_folder` find it.

    Args:
        path: path of the new folder.
        check_old: is called with what is there, before anything is written and before it is
            replaced; it raises to keep it.

    Raises:
        OSError: the folder above cannot be written to.
    """
    target = Path(path).resolve()
    _take_back(target)
    _remove_abandoned(target)
    _check(target, check_old)
    temporary, lock = _claimed(target, Path.mkdir)
    try:
        yield temporary
        for file in temporary.iterdir():
            _sync(file)
        _sync(temporary)
        _check(target, check_old)
        if not _takes_free_name(temporary, target):
            # Perhaps another process has taken it since.
            _check(target, check_old)
            _replace(temporary, target)
        _sync(target.parent)
    finally:
        os.close(lock)
        shutil.rmtree(temporary, ignore_errors=True)


def find_folder(path: str | PathLike[str]) -> Path:
    """Return where the folder of `path` is: there, or aside if a process died replacing it."""
    target = Path(path).resolve()
    aside = [] if os.path.lexists(target) else _hidden_beside(target, "old")
    return aside[0] if aside else Path(path)


def _claimed(target: Path, make: Callable[[Path], None]) -> tuple[Path, int]:
    """Make something temporary beside `target`, and return it with the lock on it."""
    while True:
        temporary = _hidden(target, "partial")
        make(temporary)
        # Between making and locking it another process may take it for abandoned and remove it.
        with suppress(FileNotFoundError):
            lock = os.open(temporary, os.O_RDONLY)
            if _is_locked(lock) and temporary.exists():
                return temporary, lock
            os.close(lock)


def _make_file(path: Path) -> None:
    path.touch(exist_ok=False)


def _is_locked(file: int) -> bool:
    """Try to take a lock, and return whether it was free."""
    try:
        _lock(file)
    except BlockingIOError:
        return False
    except OSError:
        # Where there are no locks, nobody can take one and remove what is being written.
        return True
    return True


def _check(target: Path, check_old: Callable[[Path], object]) -> None:
    if target.exists():
        check_old(target)


def _takes_free_name(temporary: Path, target: Path) -> bool:
    """Give a folder its name, and return True, if nothing has it."""
    try:
        temporary.rename(target)
    except OSError as error:
        if error.errno in _TAKEN:
            return False
        raise
    return True


def _replace(temporary: Path, target: Path) -> None:
    if not _exchange(temporary, target):
        aside = _hidden(target, "old")
        target.rename(aside)
        try:
            temporary.rename(target)
        except OSError:
            aside.rename(target)
            raise
        shutil.rmtree(aside, ignore_errors=True)


def _exchange(one: Path, other: Path) -> bool:
    """Let two files or folders swap names at once; return whether the system can."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except AttributeError:
        return False
    if rename(_AT_FDCWD, bytes(one), _AT_FDCWD, bytes(other), _RENAME_EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in _NOT_SUPPORTED:
        return False
    raise OSError(number, os.strerror(number), str(other))


def _take_back(target: Path) -> None:
    aside = find_folder(target)
    if aside != target:
        aside.rename(target)


def _remove_abandoned(target: Path) -> None:
    for path in (*_hidden_beside(target, "partial"), *_hidden_beside(target, "old")):
        # Whoever still writes holds a lock.
        with suppress(OSError):
            lock = os.open(path, os.O_RDONLY)
            try:
                _lock(lock)
                if path.is_dir():
                    shutil.rmtree(path)
                else:
                    path.unlink()
            finally:
                os.close(lock)


def _hidden(target: Path, kind: str) -> Path:
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}.{kind}")


def _hidden_beside(target: Path, kind: str) -> list[Path]:
    """Return what `_hidden` has named, the newest first."""
    found = target.parent.glob(f".{glob.escape(target.name)}.{'[0-9a-f]' * 8}.{kind}")
    return sorted(found, key=_time, reverse=True)


def _time(path: Path) -> int:
    # Another process may have removed it by now.
    with suppress(FileNotFoundError):
        return path.lstat().st_mtime_ns
    return 0


def _lock(file: int) -> None:
    """Take the lock of a file or folder, which falls with the process, or raise OSError."""
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _sync(path: Path) -> None:
    """Wait until the disk has a file, or the names in a folder where that is possible."""
    file = os.open(path, os.O_RDONLY)
    try:
        os.fsync(file)
    except OSError as error:
        if error.errno not in _NOT_SUPPORTED:
            raise
    finally:
        os.close(file)
