# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Set-up steps that tolerate interruption and concurrent runs."""

import contextlib
import fcntl
import hashlib
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


class Refusal(Exception):
    """The set-up cannot run; the text says in one sentence what to change."""


@contextlib.contextmanager
def exclusive_lock() -> Iterator[None]:
    """Lock this workspace, so that one process at a time changes it.

    The programs that it starts inherit the lock. If it is killed while one of them goes on, the
    next run waits for that one before it changes files.
    """
    with (ROOT / ".lock").open("w") as lock:
        os.set_inheritable(lock.fileno(), True)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("Waiting for another set-up or build of this workspace ...")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def run(*command: str | Path, environ: Mapping[str, str]) -> None:
    """Run a program in the root of the workspace; it holds the lock until it ends."""
    words = [str(word) for word in command]
    # Without close_fds=False the program would not inherit the lock.
    code = subprocess.run(words, env=environ, cwd=ROOT, close_fds=False, check=False).returncode
    if code != 0:
        what = shlex.join(words[:4])
        raise Refusal(f"`{what} ...` failed with exit code {code}; its own messages stand above.")


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def write_atomically(path: Path, text: str) -> None:
    partial = path.with_name(path.name + ".partial")
    partial.write_text(text)
    partial.replace(path)


def digest(*parts: str | bytes) -> str:
    """Return one hash over all parts and their lengths."""
    whole = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        whole.update(len(data).to_bytes(8, "big") + data)
    return whole.hexdigest()
