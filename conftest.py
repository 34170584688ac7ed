# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Settings and fixtures of the tests of all packages and of the workspace."""

import io
import os
import resource
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

PROFILE = Path(__file__).parent / "tools" / "fastdds_tests.xml"

os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(PROFILE))

Command = Callable[[str], tuple[int, str, str]]


@pytest.fixture
def grid_map_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Command:
    """Function that runs a line of `grid-map` in this process, in a folder of the test's own.

    It returns the exit code, the output and the errors.
    """
    from grid_map_core_py.commands import main

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"nothing")))

    def run(line: str) -> tuple[int, str, str]:
        try:
            code = main(line.split())
        except SystemExit as end:
            code = end.code
        return code, *capfd.readouterr()

    return run


@pytest.fixture
def refused(request: pytest.FixtureRequest) -> Callable[[str], tuple[int, str]]:
    """Function that runs a wrong line of `grid-map`, by the fixture `command` of the test.

    It checks that the error is one line, and returns the exit code and the error.
    """
    command: Command = request.getfixturevalue("command")

    def run(line: str) -> tuple[int, str]:
        code, output, error = command(line)
        assert output == ""
        assert error.startswith("grid-map: error: ")
        assert error.count("\n") == 1
        return code, error

    return run


@pytest.fixture
def full_disk() -> Callable[[int], AbstractContextManager[None]]:
    """Return a context manager in which files of this process grow to some bytes only."""

    @contextmanager
    def limited(size: int) -> Iterator[None]:
        usual = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, usual[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, usual)

    return limited
