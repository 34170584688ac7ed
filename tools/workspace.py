# SPDX-License-Identifier: BSD-3-Clause
"""Set up and build this workspace.

Usage: tools/workspace setup|build|browser|docs|oldest|exports

    setup       create the Python environment `.venv`
    build       run `setup`, then `colcon build` for changed packages
    browser     run `setup`, then find or install Chromium for the tests
    docs        create `.venv-docs` for building the documentation
    oldest      create `.venv-oldest` with the oldest supported versions of all requirements
    exports     print the shell commands that tools/env.sh evaluates

There are two modes. A sourced ROS 2 Jazzy is used as it is, and `.venv` adds the few missing
tools. Otherwise, `.venv` contains ROS 2 Jazzy itself, from PyPI wheels.

Each step ends by writing a stamp with a hash of its inputs. An interrupted step has no stamp and
is repeated.
"""

import json
import os
import shlex
import shutil
import signal
import sys
from collections.abc import Mapping
from pathlib import Path

import environment
import machine
from steps import ROOT, Refusal, digest, exclusive_lock, run, say, write_atomically

BUILT = ROOT / "install" / ".built.json"
"""Stamp of the build: a hash of the sources of each installed package."""


def build(inner: Mapping[str, str], fingerprint: str) -> None:
    """Run `colcon build` for the packages whose sources have changed since they were installed."""
    packages = sorted(path.parent for path in ROOT.glob("*/package.xml"))
    wanted = {package.name: _source_digest(package, fingerprint) for package in packages}
    built = json.loads(BUILT.read_text()) if BUILT.exists() else {}
    current = {name: value for name, value in built.items() if wanted.get(name) == value}
    if wanted == built:
        return
    BUILT.parent.mkdir(exist_ok=True)
    write_atomically(BUILT, json.dumps(current))
    # Start from scratch, because colcon does not uninstall files that were removed from sources.
    for name in (wanted | built).keys() - current.keys():
        shutil.rmtree(ROOT / "build" / name, ignore_errors=True)
        shutil.rmtree(ROOT / "install" / name, ignore_errors=True)
    if outdated := [name for name in wanted if name not in current]:
        say(f"Building {', '.join(outdated)} ...")
        # Show compiler output, which indicates progress, immediately.
        words = (
            "--event-handlers",
            "console_direct+",
            "console_stderr-",
            "--packages-select",
            *outdated,
        )
        run("colcon", "build", *words, environ=inner, takes_long=True)
    write_atomically(BUILT, json.dumps(wanted))


def _source_digest(package: Path, fingerprint: str) -> str:
    """Return a hash of the installed sources of a package and of its build tools."""
    parts: list[str | bytes] = [fingerprint]
    for path in sorted(package.rglob("*")):
        inside = path.relative_to(package)
        transient = any(part.startswith((".", "__pycache__")) for part in inside.parts)
        if path.is_file() and inside.parts[0] != "test" and not transient:
            parts += [str(inside), path.read_bytes()]
    return digest(*parts)


def exports(outer: Mapping[str, str], ros: bool) -> None:
    """Print shell commands that turn the environment `outer` into the inner environment."""
    if not environment.is_set_up(ros):
        world = "a sourced ROS" if ros else "a shell without ROS"
        raise Refusal(f"{ROOT} is not set up for {world}: run `make build` there first.")
    inner = environment.inner_environment(outer, ros)
    for name in (*machine.PATH_LISTS, machine.NO_BYTE_CODE):
        if name not in inner:
            print(f"unset {name}")
    for name, value in inner.items():
        if name in machine.PATH_LISTS or outer.get(name) != value:
            print(f"export {name}={shlex.quote(value)}")


def carry_out(command: str) -> None:
    outer = machine.outer_environment(os.environ)
    ros = machine.ros_is_sourced(outer)
    if command == "exports":
        exports(outer, ros)
        return
    machine.check(outer, ros)
    with exclusive_lock():
        if command == "docs":
            environment.setup_docs(outer, ros)
            return
        if command == "oldest":
            environment.setup_oldest(outer)
            return
        fingerprint = environment.setup(outer, ros)
        inner = environment.inner_environment(outer, ros)
        if command == "build":
            build(inner, fingerprint)
        if command == "browser":
            environment.ensure_browser(inner)


def main(arguments: list[str]) -> int:
    known = ("setup", "build", "browser", "docs", "oldest", "exports")
    if len(arguments) != 1 or arguments[0] not in known:
        say(str(__doc__))
        return 2
    try:
        carry_out(arguments[0])
    except Refusal as refusal:
        say(str(refusal))
        return 1
    except KeyboardInterrupt:
        say("Interrupted; the next run takes it up again.")
        return 130
    return 0


if __name__ == "__main__":
    exit_code = main(sys.argv[1:])
    # No child process is left to interrupt.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(exit_code)
