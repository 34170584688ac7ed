# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`grid-map doctor`."""

import json
import sys

import pytest

from grid_map_core_py._commands import doctor
from grid_map_core_py.commands import main


@pytest.fixture(autouse=True)
def healthy(monkeypatch):
    """Set ROS so that nothing contradicts."""
    for name in ("ROS_LOCALHOST_ONLY", "FASTRTPS_DEFAULT_PROFILES_FILE", "RMW_IMPLEMENTATION"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def test_healthy_machine_has_no_failures(capfd):
    code = main(["doctor", "--json"])
    found = json.loads(capfd.readouterr().out)
    assert (code, found["ok"], found["problems"]) == (0, True, [])
    assert found["python"]["executable"] == sys.executable
    assert found["packages"].keys() == doctor.PACKAGES.keys()
    numpy = found["packages"]["numpy"]
    assert (numpy["status"], numpy["gives"]) == ("ok", "arrays")
    assert numpy["text"].count(".") >= 1
    assert found["settings"]["ROS_DOMAIN_ID"] == "7"


def test_failures_are_listed_last_and_in_the_exit_code(capfd, monkeypatch):
    monkeypatch.setattr(doctor, "PACKAGES", {"numpy": ("arrays", "apt"), "nothing": ("x", "pip")})
    assert main(["doctor"]) == 0
    text = capfd.readouterr().out
    assert "missing  nothing  x (pip)\n" in text
    assert text.endswith("All that is installed works.\n")
    monkeypatch.setattr(doctor, "REQUIRED", ("nothing",))
    monkeypatch.setenv("ROS_DOMAIN_ID", "900")
    assert main(["doctor"]) == 1
    text = capfd.readouterr().out
    assert text.endswith("To repair: nothing, ROS_DOMAIN_ID\n")


@pytest.mark.parametrize(
    ("name", "value", "problem"),
    [
        ("ROS_DOMAIN_ID", "", ""),
        ("ROS_DOMAIN_ID", "-1", "expected 0 to 232, got -1"),
        ("ROS_DOMAIN_ID", "seven", "expected 0 to 232, got seven"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET", ""),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "EVERYWHERE", "expected OFF, LOCALHOST"),
        ("ROS_LOCALHOST_ONLY", "1", ""),
        ("RMW_IMPLEMENTATION", "rmw_of_nobody", "rmw_of_nobody is not installed"),
        ("ROS_DISTRO", "humble", "expected jazzy, got humble"),
        ("FASTRTPS_DEFAULT_PROFILES_FILE", __file__, "cannot be read: not well-formed"),
        ("FASTDDS_DEFAULT_PROFILES_FILE", "/none.xml", "cannot be read: [Errno 2]"),
        ("AMENT_PREFIX_PATH", "/nowhere", "there is no folder /nowhere"),
    ],
)
def test_settings_that_cannot_work_are_named(name, value, problem, monkeypatch):
    before = [*doctor.contradictions()]
    monkeypatch.setenv(name, value)
    new = [found for found in doctor.contradictions() if found not in before]
    assert [found[0] for found in new] == ([name] if problem else [])
    assert problem in "".join(text for _, text in new)


def test_settings_that_contradict_are_named(monkeypatch, tmp_path):
    (tmp_path / "profile.xml").write_text("<dds/>")
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(tmp_path / "profile.xml"))
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    reason = "overrules ROS_AUTOMATIC_DISCOVERY_RANGE, which is SUBNET"
    assert [*doctor.contradictions()] == [("ROS_LOCALHOST_ONLY", reason)]


def test_modules_that_break_or_end_python_are_broken(tmp_path, monkeypatch):
    (tmp_path / "breaks.py").write_text("print('hello')\nraise OSError('no library')\n")
    (tmp_path / "needs.py").write_text("import that_is_not_there\n")
    (tmp_path / "dies.py").write_text("import os\nos._exit(7)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")
    names = ["json", "breaks", "is_not_there", "dies", "needs", "is_not_there.msg"]
    found = doctor.examined(names)
    assert [*found] == names
    statuses = ["ok", "broken", "missing", "broken", "broken", "missing"]
    assert [status for status, _ in found.values()] == statuses
    assert found["breaks"][1] == "no library"
    assert found["dies"][1] == "importing it ends Python with exit code 7"
    assert "that_is_not_there" in found["needs"][1]
