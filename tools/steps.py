# SPDX-License-Identifier: BSD-3-Clause
"""Setup steps that tolerate interruptions and concurrent runs."""

import contextlib
import fcntl
import hashlib
import os
import shlex
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

PERIOD = 10.0
"""Time between two progress lines of a program [s]."""


class Refusal(Exception):
    """The setup cannot run; the text says in one sentence what to change."""


@contextlib.contextmanager
def exclusive_lock() -> Iterator[None]:
    """Lock this workspace, so that one process at a time changes it.

    Child processes inherit the lock. If this process is killed while a child still runs, the next
    run waits for the child before changing files.
    """
    with (ROOT / ".lock").open("w") as lock:
        os.set_inheritable(lock.fileno(), True)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("Waiting for another set-up or build of this workspace ...")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def run(*command: str | Path, environ: Mapping[str, str], takes_long: bool = False) -> None:
    """Run a program in the workspace root; the program holds the lock until it ends.

    With `takes_long`, the last output line is printed every `PERIOD`, and all output if the program
    fails.
    """
    words = [str(word) for word in command]
    output = subprocess.PIPE if takes_long else None
    # Without close_fds=False the program would not inherit the lock.
    with subprocess.Popen(
        words, env=environ, cwd=ROOT, close_fds=False, stdout=output, text=True
    ) as process:
        lines: list[str] = []
        if process.stdout is not None:
            started = time.monotonic()
            reader = threading.Thread(target=lines.extend, args=[process.stdout], daemon=True)
            reader.start()
            while reader.join(PERIOD) or reader.is_alive():
                last = lines[-1].strip()[:80] if lines else ""
                say(f"{time.monotonic() - started:5.0f} s  {last}")
    code = process.returncode
    if code != 0:
        sys.stderr.writelines(lines)
        what = shlex.join(words[:4])
        raise Refusal(f"`{what} ...` failed with exit code {code}; its own messages stand above.")


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def write_atomically(path: Path, text: str) -> None:
    partial = path.with_name(path.name + ".partial")
    partial.write_text(text)
    partial.replace(path)


def digest(*parts: str | bytes) -> str:
    """Return a hash of all parts and their lengths."""
    whole = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        whole.update(len(data).to_bytes(8, "big") + data)
    return whole.hexdigest()
