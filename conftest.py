# SPDX-License-Identifier: BSD-3-Clause
"""Settings and fixtures of the tests of all packages and of the workspace."""

import importlib.util
import io
import os
import random
import resource
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest

from grid_map_core_py.testing import register_profiles

PROFILE = Path(__file__).parent / "tools" / "fastdds_tests.xml"
MISSING = (
    "the tests need hypothesis, which is not installed: run `rosdep install --from-paths src "
    "--ignore-src -y` in your workspace, or `pip install hypothesis`"
)

os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(PROFILE)

HAS_HYPOTHESIS = importlib.util.find_spec("hypothesis") is not None
if HAS_HYPOTHESIS:
    register_profiles()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option for random order; `GRID_MAP_SHUFFLE` is the same."""
    about = "run modules, and tests within them, in random order"
    seed = os.environ.get("GRID_MAP_SHUFFLE")
    parser.addoption("--shuffle", default=seed, metavar="SEED", help=about)


def pytest_configure() -> None:
    """Say in one line what is missing."""
    if not HAS_HYPOTHESIS:
        raise pytest.UsageError(MISSING)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Shuffle modules and tests within them, if wanted; let Ctrl-C end the tests in order."""
    # Executables that tests import leave it to the operating system.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if seed := config.getoption("--shuffle"):
        # Tests of a module stay together, because they share slow fixtures.
        generator = random.Random(seed)
        modules = {item.path: generator.random() for item in items}
        items.sort(key=lambda item: (modules[item.path], generator.random()))


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a test that needs a missing module.

    Modules must not skip when they are imported: launch_testing, which is part of ROS, imports them
    while pytest collects, and a skip at that time ends the session without any test.
    """
    for mark in item.iter_markers("needs"):
        for module in mark.args:
            pytest.importorskip(module)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Fail without tests; colcon would count such a session as a success."""
    if exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any, exitstatus: int) -> None:
    """Say why a session without tests fails."""
    if exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED:
        terminalreporter.write_line("no test was collected, which counts as a failure", red=True)


Command = Callable[[str], tuple[int, str, str]]


@pytest.fixture
def grid_map_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Command:
    """Function that runs a line of `grid-map` in this process, in a folder of the test's own.

    It returns the exit code, the output and the errors.
    """
    from grid_map_core_py._commands import main

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
def full_disk(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], AbstractContextManager[None]]:
    """Return a context manager in which files of this process grow to some bytes only."""
    # Python may leave byte code that is cut off, which breaks later programs.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")

    @contextmanager
    def limited(size: int) -> Iterator[None]:
        usual = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, usual[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, usual)

    return limited
