# SPDX-License-Identifier: BSD-3-Clause
"""Exit codes and messages of executables."""

import re
import signal
import sys
import time
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from conftest import NODES, Start
from grid_map_ros_py.testing import Peer, Process, wait_until

INTERRUPTED_IMPORT = """
import os, signal, sys
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # as the first line of executables does
import grid_map_ros_py._executables
assert "rclpy" not in sys.modules
os.kill(os.getpid(), signal.SIGINT)
import rclpy
"""


def wait_until_alive(process: Process) -> None:
    wait_until(lambda: process.lines, "a sign of life")
    assert process.lines == ["alive\n"]


@pytest.mark.parametrize(
    ("habit", "number"),
    [("idle", signal.SIGTERM), ("busy", signal.SIGINT), ("slow", signal.SIGHUP)],
)
def test_signal_ends_the_node_with_exit_code_0(
    start: Start, habit: str, number: signal.Signals
) -> None:
    process = start("living.py", habit)
    wait_until_alive(process)
    process.send_signal(number)
    assert process.wait() == 0
    assert process.lines == ["alive\n", "destroyed\n"]


@pytest.mark.parametrize("habit", ["idle", "stuck"])
def test_further_interrupts_end_stuck_callbacks_and_change_nothing_else(
    start: Start, habit: str
) -> None:
    def interrupt() -> None:
        process.send_signal(signal.SIGINT)
        time.sleep(0.01)  # Thousands of interrupts would also disturb Python itself.

    process = start("living.py", habit)
    wait_until_alive(process)
    wait_until(lambda: not process.is_running, "its end", step=interrupt)
    assert process.wait() == 0
    assert process.lines == ["alive\n", "destroyed\n"]


def test_second_interrupt_during_an_import_ends_the_node(start: Start) -> None:
    process = start("living.py", "importing")
    assert process.wait() == 0
    assert process.lines == []


def test_interrupt_during_imports_leaves_no_traceback() -> None:
    process = Process([sys.executable, "-c", INTERRUPTED_IMPORT])
    assert process.wait() == -signal.SIGINT
    assert process.lines == []


@pytest.mark.parametrize(
    ("habit", "message", "exception"),
    [
        ("misconfigured", "filter 3 'smooth': unknown parameter 'radiu'", ""),
        ("misnamed", "Invalid topic name: topic name must not .*: 'no topic'", ""),
        ("gives up", "the battery is empty", ""),
        ("buggy", "a bug", "ZeroDivisionError"),
        ("buggy while it lives", "a bug", "grid_map_core_py.errors.GridMapError"),
    ],
)
def test_failing_node_logs_and_reports_one_error(
    start: Start, other_side: Peer, habit: str, message: str, exception: str
) -> None:
    other_side.listen("/diagnostics", DiagnosticArray, 10)
    process = start("living.py", habit)
    (found,) = other_side.expect("/diagnostics").status
    assert (found.name, found.level) == ("being", DiagnosticStatus.ERROR)
    assert re.fullmatch(message, found.message)
    assert process.wait() == 1
    if exception:
        assert "Traceback" in process.text
        assert "FATAL" not in process.text
        assert f"{exception}: {message}\n" in process.text
    else:
        (line,) = [line for line in process.lines if line not in ("alive\n", "destroyed\n")]
        assert re.fullmatch(rf"\[FATAL\] .*\[being\]: {message}\n", line)


def test_given_parameters_that_are_not_used_are_warned_of(start: Start, tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    shared = "{other: 1, forest: {leaf: 2}}"
    file.write_text(
        f"/**: {{ros__parameters: {shared}}}\n"
        "being: {ros__parameters: {other: 1, dely: 0.0, tree.stem: 1, tree.root: 2}}\n"
        "robot/*: {ros__parameters: {delay: 0.0}}\n"
    )
    given = ["--ros-args", "--params-file", str(file), "-p", "quite_unlike:=1"]
    process = start("living.py", "idle", *given)
    wait_until(lambda: "alive\n" in process.lines, "a sign of life")
    (warning,) = [line for line in process.lines if "WARN" in line]
    assert re.search(r"\[being\]: unknown parameters, not used: (.*)\n", warning)[1] == (
        "'dely' (did you mean delay?), 'quite_unlike', 'tree'"
    )


def parameter_files(folder: Path, sections: list[str]) -> list[Path]:
    """Write a parameter file with each section."""
    paths = [folder / f"{number}.yaml" for number in range(len(sections))]
    for path, section in zip(paths, sections, strict=True):
        ends = "}" * (1 + section.count("{"))
        path.write_text(f"{section}: {{ros__parameters: {{delay: 0.001}}{ends}")
    return paths


OTHERS = ["beings", "robot/being", "/*/being", "robot: {being"]


def test_parameter_files_without_section_for_the_node_are_reported(
    start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    paths = parameter_files(tmp_path, [*OTHERS, "being", "/being", "/*", "/**", "/**/being"])
    files = [word for path in paths for word in ("--params-file", path.name)]
    process = start("living.py", "idle", "--ros-args", *files)
    wait_until(lambda: "alive\n" in process.lines, "a sign of life")
    names = ("beings", "robot/being", "*/being", "robot/being")
    warnings = [
        f"no section of {path.name} matches /being; the file has /{name}"
        for path, name in zip(paths, names, strict=False)
    ]
    assert f"[being]: {'; '.join(warnings)}\n" in process.text


def test_node_that_fails_reports_its_parameter_file(start: Start, tmp_path: Path) -> None:
    (file,) = parameter_files(tmp_path, OTHERS[:1])
    process = start("living.py", "misconfigured", "--ros-args", "--params-file", str(file))
    assert process.wait() == 1
    assert process.text.count(f"no section of {file} matches /being; the file has /beings") == 1


@pytest.mark.parametrize("wrong", [["--nonsense"], ["--params-file", "/missing.yaml"]])
def test_wrong_ros_arguments_are_reported_without_traceback(start: Start, wrong) -> None:
    process = start("living.py", "idle", "--ros-args", *wrong)
    assert process.wait() == 1
    assert wrong[-1] in process.text
    assert "Traceback" not in process.text


def test_node_without_keys_does_not_start_under_enforced_security(tmp_path: Path) -> None:
    (tmp_path / "enclaves" / "robot").mkdir(parents=True)
    enforced = {"ENABLE": "true", "STRATEGY": "Enforce", "KEYSTORE": str(tmp_path)}
    words = ["idle", "--ros-args", "--enclave", "/robot"]
    settings = {f"ROS_SECURITY_{name}": enforced[name] for name in enforced}
    process = Process([sys.executable, str(NODES / "living.py"), *words], settings)
    assert process.wait() == 1
    assert f"directory: {tmp_path}/enclaves/robot\n" in process.text
    assert process.text.count("[FATAL]") == 1
    assert not re.search("alive|Traceback", process.text)


@pytest.mark.parametrize(
    "content",
    [
        "filters:\n  - {name: a, type: b}\n",
        "node: {ros__parameters: {filters: [{name: a, params: {radius: 1.0}}]}}",
        "node: {ros__parameters: {input_sources: {}, rate: 1}}",
    ],
    ids=["chain", "list", "empty mapping"],
)
def test_parameter_file_of_ros_1_names_the_page_on_migration(
    start: Start, content: str, tmp_path: Path
) -> None:
    path = tmp_path / "ros1.yaml"
    path.write_text(content)
    process = start("living.py", "idle", "--ros-args", "--params-file", str(path))
    assert process.wait() == 1
    assert ("Write an empty mapping as []. Param" in process.text) == ("1.0" not in content)
    assert "docs/migration_ros1.md#parameters" in process.text
    assert ("Name the items of a list of mappings: filter1, f" in process.text) == (
        "1.0" in content
    )
    assert str(path) in process.text
