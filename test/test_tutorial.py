# SPDX-License-Identifier: BSD-3-Clause
"""The tutorial, followed literally from a clone to a filter in one's own package.

In a copy of the repository and an empty home, section after section, block after block:
    file="..."      becomes that file, whatever the language.
    bash            a shell of its own, in the folder of the clone. Where the comment on its last
                    line ends in `until Ctrl-C`, that program runs beside what follows until the end
                    of the section. The comment says how one sees that it works: it publishes a
                    topic, or says where its page is. Interrupted, it must end with exit code 0.
    python          is typed into the `python3` that the block before has started.
    text output     is what the block before has printed.

The environment of this workspace is lent to the copy, and so is the package of messages that is
built already, because to make them takes minutes. The other packages are built anew.
"""

import os
import re
import shutil
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import groupby, takewhile
from pathlib import Path

import numpy as np
import pytest
from pages import Block, page

from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message
from grid_map_ros_py.testing import Peer, Process, environment, peer, running
from scratch import ROOT, run

TUTORIAL = page("docs/tutorial.md")
LENT = "grid_map_msgs"
LEFT_OUT = ("build", "install", "log", "demo_output", "__pycache__", ".*", "*.egg-info")
ENDLESS = re.compile(r"   # (?:publishes (/\S+)|says where the page is),? until Ctrl-C\n$")

LEND = """
import json, os, sys
import environment, machine, steps, workspace
outer = machine.outer_environment(os.environ)
fingerprint = environment._wanted(machine.ros_is_sourced(outer))
steps.write_atomically(environment.VENV / ".complete", fingerprint)
digest = workspace._source_digest(steps.ROOT / sys.argv[1], fingerprint)
steps.write_atomically(workspace.BUILT, json.dumps({sys.argv[1]: digest}))
"""
"""Writes the stamps that the tools of the copy would have written."""


def clone(folder: Path) -> Path:
    """Copy the files of the repository; link the environments, which take minutes to make."""
    shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*LEFT_OUT))
    (folder / ".venv").mkdir()
    for path in (ROOT / ".venv").iterdir():
        if path.name != ".complete":
            (folder / ".venv" / path.name).symlink_to(path)
    shutil.copytree(ROOT / "install" / LENT, folder / "install" / LENT, symlinks=True)
    path = f"{folder}/tools:{os.environ['PYTHONPATH']}"
    done = run(sys.executable, "-c", LEND, LENT, environ={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 0, done.stderr
    return folder


def sections() -> Iterator[list[Block]]:
    """Yield the blocks of each section of the page."""
    lines = TUTORIAL.text.splitlines()
    for _, blocks in groupby(
        TUTORIAL.blocks,
        lambda block: sum(line.startswith("## ") for line in lines[: block.line]),
    ):
        yield [*blocks]


class Newcomer:
    """A reader who follows the page, in an empty home."""

    def __init__(self, folder: Path, listener: Peer) -> None:
        self.clone = clone(folder / "clone")
        self.home = folder / "home"
        self.home.mkdir()
        self.listener = listener
        self.environ = {**environment(), "HOME": str(self.home), "PYTHONDONTWRITEBYTECODE": "1"}

    def follow(self, blocks: list[Block]) -> None:
        """Run the blocks of a section, and interrupt all its programs at the end."""
        with ExitStack() as programs:
            while blocks:
                block, *blocks = blocks
                if block.file:
                    self.write(block)
                elif found := ENDLESS.search(block.text):
                    self.wait_for(programs.enter_context(running(self.start(block))), found[1])
                else:
                    blocks = self.run_and_type(block, blocks)

    def write(self, block: Block) -> None:
        path = self.home / block.file.removeprefix("~/")
        assert path.parent.is_dir(), f"{block}: its folder has not been made"
        path.write_text(block.text)

    def run_and_type(self, block: Block, following: list[Block]) -> list[Block]:
        """Run commands, type the Python that follows, and return the blocks after that."""
        assert block.language == "bash", f"{block}: who runs this?"
        typed = [*takewhile(lambda other: other.language == "python", following)]
        typed = [*takewhile(lambda other: not other.file, typed)]
        rest = following[len(typed) :]
        script = f'exec <<<"$1"\n{block.text}'
        keys = "".join(other.text for other in typed)
        done = run("bash", "-ec", script, "bash", keys, environ=self.environ, cwd=self.clone)
        assert done.returncode == 0, f"{block}: {done.stderr}"
        if rest and rest[0].info == "output":
            assert done.stdout == rest[0].text, block
            rest = rest[1:]
        return rest

    def start(self, block: Block) -> Process:
        *before, program = block.text.replace("\\\n", "").splitlines()
        script = "\n".join([f"cd {self.clone}", *before, f"exec {program}"])
        return Process(["bash", "-ec", script], self.environ)

    def wait_for(self, program: Process, topic: str | None) -> None:
        """Wait until a program publishes a topic or serves its page."""
        if topic:
            self.listener.listen(topic, GridMapMessage)
            self.listener.expect(topic)
        else:
            written = re.compile(r"at\n(http\S+)\n")
            self.listener.wait_until(lambda: written.search(program.text), "a page")
            address = written.search(program.text)[1]
            assert b"<html" in urllib.request.urlopen(address, timeout=10).read()


@pytest.fixture(scope="module")
def newcomer(tmp_path_factory) -> Iterator[Newcomer]:
    """A reader who has followed the page to its end."""
    with peer() as listener:
        someone = Newcomer(tmp_path_factory.mktemp("tutorial"), listener)
        for blocks in sections():
            someone.follow(blocks)
        yield someone


def test_tutorial_produces_the_layer_of_the_new_filter(newcomer):
    terrain = from_message(newcomer.listener.received["/grid_map"][-1])
    flooded = from_message(newcomer.listener.received["/filtered_map"][-1])
    assert flooded.layers == (*terrain.layers, "filled", "water_depth")
    assert np.isfinite(flooded["water_depth"]).all()
    for ground, depth in zip(terrain["elevation"].flat, flooded["water_depth"].flat, strict=True):
        assert depth == 0.0 if ground > 0.1 else not abs(ground + depth - 0.1) > 1e-6


def test_tutorial_writes_its_pictures(newcomer):
    for name in ("hill.png", "flood.png"):
        assert (newcomer.home / name).read_bytes().startswith(b"\x89PNG")


def test_tutorial_builds_the_package_outside_the_clone(newcomer):
    assert (newcomer.home / "my_ws/install/my_filters/share/my_filters/config/flood.yaml").exists()
    assert not (newcomer.clone / "install" / "my_filters").exists()
