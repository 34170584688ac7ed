# SPDX-License-Identifier: BSD-3-Clause
"""Machine code on disk, in the folder `grid_map_py` of the user's cache.

Loading machine code means executing it. A folder or file is trusted only if it belongs to the user
and neither its group nor others can write to it. The folders above must belong to the user or root,
and others must not be able to exchange what they hold. A link in place of the folder or of a file
is not followed. Each file begins with a digest of its key and its content, so that a damaged one
counts as missing. A process writes a file under another name and renames it: others see it complete
or not at all.
"""

import hashlib
import os
import secrets
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_DIGEST = 32  # bytes
_LARGEST = 1 << 20  # bytes; machine code of a loop has some thousand
_OTHERS_CAN_WRITE = 0o022
_ENDING = ".partial"
_LONGEST = 3600.0  # seconds; writing takes some milliseconds


@contextmanager
def open_folder() -> Iterator[int | None]:
    """Yield a descriptor of the folder, which is made if it is missing; None if not trusted."""
    number = None
    with suppress(OSError, RuntimeError):
        number = _opened(_path())
    try:
        yield number
    finally:
        if number is not None:
            os.close(number)


def is_writable(folder: int) -> bool:
    """Return whether files can be written, unlike in a folder on a read-only disk."""
    return os.access(".", os.W_OK, dir_fd=folder)


def read(folder: int, name: str, key: bytes) -> bytes | None:
    """Return the machine code in a file; None if it is missing, damaged or not to be trusted."""
    with suppress(OSError):
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        file = os.open(name, flags, dir_fd=folder)
        try:
            about = os.fstat(file)
            if not (_is_trusted(about) and stat.S_ISREG(about.st_mode)):
                return None
            content = os.read(file, _LARGEST)
        finally:
            os.close(file)
        code = content[_DIGEST:]
        if content[:_DIGEST] == _digest(key, code):
            return code
    return None


def write(folder: int, name: str, key: bytes, code: bytes) -> bool:
    """Write machine code into a file; return whether that succeeded."""
    content, temporary = _digest(key, code) + code, f".{name}.{secrets.token_hex(4)}{_ENDING}"
    with suppress(OSError):
        _remove_remains(folder)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        file = os.open(temporary, flags, 0o600, dir_fd=folder)
        try:
            with os.fdopen(file, "wb") as stream:
                stream.write(content)
            os.rename(temporary, name, src_dir_fd=folder, dst_dir_fd=folder)
            return True
        except OSError:
            os.unlink(temporary, dir_fd=folder)
    return False


def _remove_remains(folder: int) -> None:
    """Remove files that processes were writing when they were killed."""
    for name in os.listdir(folder):
        if name.endswith(_ENDING):
            age = time.time() - os.stat(name, dir_fd=folder, follow_symlinks=False).st_mtime
            if age > _LONGEST:
                os.unlink(name, dir_fd=folder)


def _path() -> Path:
    """Return where the folder is: in $XDG_CACHE_HOME, or else in ~/.cache."""
    cache = Path(os.environ.get("XDG_CACHE_HOME", ""))
    # The standard ignores relative paths.
    cache = cache if cache.is_absolute() else Path.home() / ".cache"
    return cache.resolve() / "grid_map_py"


def _opened(path: Path) -> int | None:
    if os.name != "posix":
        return None
    above = next(folder for folder in path.parents if folder.exists())
    # With the home of another user, as under sudo, the folder would be in that user's way.
    if not path.exists() and above.stat().st_uid == os.geteuid():
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not all(_is_fixed(folder.stat()) for folder in path.parents):
        return None
    number = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    if _is_trusted(os.fstat(number)):
        return number
    os.close(number)
    return None


def _is_trusted(about: os.stat_result) -> bool:
    return about.st_uid == os.geteuid() and not about.st_mode & _OTHERS_CAN_WRITE


def _is_fixed(about: os.stat_result) -> bool:
    """Return whether only the user and root can exchange the user's folders in a folder."""
    is_shared = about.st_mode & stat.S_IWOTH and not about.st_mode & stat.S_ISVTX
    return about.st_uid in {0, os.geteuid()} and not is_shared


def _digest(key: bytes, code: bytes) -> bytes:
    return hashlib.sha256(key + code).digest()
